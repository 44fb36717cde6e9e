"""How an estimate is shown: table and verdict on the terminal, page with pictures, estimate.json."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from haptic_teleop_sysid.estimation.residuals import Residuals, reading
from haptic_teleop_sysid.estimation.result import Estimate
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.small_motion import hardly_moving, judged
from haptic_teleop_sysid.report import Page, Panel, Plot, Series, Status, unit_text
from haptic_teleop_sysid.report.terminal_table import TerminalTable
from haptic_teleop_sysid.runs.comparison_pictures import input_panel, percent_text, within
from haptic_teleop_sysid.runs.parameter_table import HEADER, Row, as_text, parameter_rows
from haptic_teleop_sysid.runs.residual_picture import residual_picture
from haptic_teleop_sysid.simulation.fit import SimulatedFit
from haptic_teleop_sysid.simulation.windows import closed_loop

_DISAGREEMENT = (
    "predicting {ahead:.2g} s ahead, where slow motion counts for more, takes {value:.4g}{unit} instead: "
    "more than chance makes it differ."
)
_OPEN = (
    "Either the measured input carries noise, or something is missing from the model: for slow motion trust "
    "--method output-error."
)
_LOOPED = "Something is missing from the model, or acts that nobody recorded: look at the residuals first."
_SHOWN = ("parameter", "estimate", "std. error", "unit", "remark")
_FURTHER = "The search may also have ended beside the best place: --multi-start 6 begins at others, too."


@dataclass(frozen=True)
class Result:
    """Everything `estimate` found. Data sets by bag, `validation` names those not used for the fit; fits by
    (start or estimate, bag); `residuals` by bag; `told` by bag: what was done to the data set."""

    estimate: Estimate
    data: dict[str, DataSet]
    validation: tuple[str, ...]
    fits: dict[tuple[str, str], SimulatedFit]
    residuals: dict[str, list[Residuals]]
    told: dict[str, list[str]]


def units_of(result: Result) -> Units:
    """The units of the machine that was estimated."""
    return Units.of(result.estimate.model, next(iter(result.data.values())))


def as_json(result: Result) -> dict[str, Any]:
    """The content of estimate.json."""
    found, unsure = result.estimate, result.estimate.uncertainty
    model = found.model
    return {
        "schema": 1,
        "robot": model.robot,
        "joint": model.joint,
        "structure": model.structure,
        "method": found.method,
        "converged": found.converged,
        "message": found.message,
        "iterations": found.iterations,
        "estimation_s": found.seconds,
        "parameters": [asdict(row) for row in parameter_rows(found, units_of(result))],
        "undetermined": {} if unsure is None else unsure.undetermined,
        "correlation": None if unsure is None else {"names": unsure.names, "matrix": unsure.correlation},
        "condition": None if unsure is None else unsure.condition,
        "log_likelihood": None if found.fit is None else found.fit.log_likelihood,
        "noise": None if found.fit is None else asdict(found.fit.noise),
        "starts": found.starts,
        "far_sighted": None if found.far_sighted is None else asdict(found.far_sighted),
        "misled": None if found.misled is None else asdict(found.misled),
        "disagreement": found.disagreement(),
        "contradictions": found.contradictions,
        "error_by_form": found.by_form,
        "fit": {
            which: {bag: result.fits[which, bag].percent for bag in result.data}
            for which in ("start", "estimate")
        },
        "windows": {
            bag: {
                "seconds": result.fits["estimate", bag].windows.seconds,
                "why": result.fits["estimate", bag].windows.why,
            }
            for bag in result.data
        },
        "recordings": {
            bag: {
                "role": "validation" if bag in result.validation else "estimation",
                "samples": len(d),
                "period_s": d.dt,
                "start_s": d.start,
                "end_s": float(d.time[-1]),
                "input": d.input_source,
                "problems": d.problems,
                "treatment": result.told[bag],
            }
            for bag, d in result.data.items()
        },
        "residuals": {
            bag: [
                {
                    "signal": r.signal,
                    "rms_rad": r.rms,
                    "bound": r.bound,
                    "auto_outside": r.outside[0],
                    "cross_outside": r.outside[1],
                }
                for r in found_
            ]
            for bag, found_ in result.residuals.items()
        },
    }


def verdict(result: Result) -> list[tuple[str, str]]:
    """(status, sentence) of what may be believed: convergence, what is undetermined, what the residuals
    say."""
    found = result.estimate
    told: list[tuple[str, str]] = []
    if found.converged:
        told.append(
            ("good", f"The search ended at an optimum after {found.iterations} iterations ({found.message}).")
        )
    else:
        told.append(
            ("bad", f"The search did not end at an optimum: {found.message}. Do not use these numbers.")
        )
    for effect, why in found.contradictions.items():
        told.append(("bad", f"{effect}: {why}. Do not use its numbers."))
    if found.misled is not None:
        told.append(("bad", misled_sentence(found)))
    if found.uncertainty is not None:
        for name, why in found.uncertainty.undetermined.items():
            told.append(("fair", f"{name} cannot be determined from these recordings: {why}."))
        looped = any(closed_loop(result.data[b]) for b in result.data if b not in result.validation)
        for name, value in found.disagreement().items():
            ahead = 0.0 if found.far_sighted is None else found.far_sighted.ahead
            unit = unit_text(units_of(result).of_parameter(found.model, name))
            sentence = _DISAGREEMENT.format(ahead=ahead, value=value, unit=f" {unit}" if unit else "")
            told.append(("bad", f"{name}: {sentence}"))
        if found.disagreement():
            told.append(("bad", _LOOPED if looped else _OPEN))
        beside = not found.converged or (found.fit is not None and bool(found.fit.at_bound))
        if (found.disagreement() or beside) and not found.starts:
            told.append(("plain", _FURTHER))
        if found.far_sighted is not None and not found.far_sighted.values:
            told.append(("plain", "The cross-check by looking further ahead did not arrive: it is silent."))
        for name in found.uncertainty.near_zero:
            told.append(("plain", f"{name} cannot be told from zero."))
    else:
        sentence = "its standard errors, where it has any, hold for an open loop and a right model only"
        told.append(("fair", f"{found.method} knows no noise: {sentence}."))
    for bag, dataset in result.data.items():
        for problem in dataset.problems:
            told.append(("fair", f"{bag}: {problem}."))
    return told


def misled_sentence(found: Estimate) -> str:
    """What is said where the one-step predictor was not believed."""
    misled = found.misled
    assert misled is not None
    values = found.model.parameter_values()
    apart = [
        f"{name} {other:.4g} instead of {values[name]:.4g}"
        for name, other in misled.values.items()
        if abs(other - values[name]) > 0.1 * abs(values[name])
    ]
    return (
        "Something quick is missing from the model, and it misleads the one-step predictor"
        + (f" ({', '.join(apart)})" if apart else "")
        + f": simulated with its values, the angles err by {100 * misled.error:.3g} % of their spread, with "
        f"those shown by {100 * misled.error_ahead:.3g} %. Shown are those of a predictor that looks some "
        f"{misled.ahead:.2g} s ahead; run diagnose to find what is missing."
    )


def tables(result: Result) -> list[TerminalTable]:
    """Parameters, and fits of start and estimate on all recordings, for the terminal."""
    found = []
    for row in parameter_rows(result.estimate, units_of(result)):
        cells = dict(zip(HEADER, as_text(row), strict=True)) | {"remark": row.status}
        if row.value is None:
            cells["estimate"] = "–"
        found.append([cells[column] for column in _SHOWN])
    fits, last = [], ""
    for bag, *rest in fit_rows(result):
        fits.append([bag if bag != last else "", *rest])  # a long name once
        last = bag
    title = f"{result.estimate.model.joint}: {result.estimate.method}"
    return [
        TerminalTable(_SHOWN, found, ("estimate", "std. error"), title),
        TerminalTable(
            ("recording", "signal", "start", "estimate"), fits, ("start", "estimate"), "simulated fit in %"
        ),
    ]


def fit_rows(result: Result) -> list[list[str]]:
    """Recording with its role, signal, fit of the start, fit of the estimate."""
    rows = []
    for bag, dataset in result.data.items():
        role = "validation" if bag in result.validation else "estimation"
        for signal in dataset.signals():
            both = [percent_text(result.fits[which, bag].percent[signal]) for which in ("start", "estimate")]
            rows.append([f"{bag} ({role})", signal, *both])
    return rows


def page(result: Result) -> Page:
    """The report."""
    found = result.estimate
    report = Page("Estimated parameters", f"{found.model.robot} {found.model.joint}, {found.method}")
    report.conclude(*_conclusion(result))
    for status, sentence in verdict(result):
        report.verdict(status, sentence)  # pyright: ignore[reportArgumentType]
    for bag in result.data:
        _recording(report, result, bag)
    rows = parameter_rows(found, units_of(result))
    report.section("Parameters").table(
        HEADER, [as_text(row) for row in rows], "Estimates with their standard errors and intervals of 95 %"
    )
    section = report.section(
        "Fit",
        "Simulated response to the recorded input, 100·(1 − ‖y − ŷ‖ / ‖y − mean y‖); "
        "initial state estimated for each window, nothing corrected along the way.",
    )
    section.table(["recording", "signal", "start", "estimate"], fit_rows(result), "in percent")
    _correlation(report, result)
    for bag, dataset in result.data.items():
        residuals = result.residuals.get(bag, [])
        if residuals:
            part = report.section(f"One-step errors, {bag}", folded=True)
            for sentence in reading(residuals, closed_loop(dataset)):
                part.text(sentence)
            part.plot(
                residual_picture(residuals, dataset.dt), "Correlation of the one-step prediction errors"
            )
    return report


def _conclusion(result: Result) -> tuple[Status, str, str]:
    """What was estimated, whether it may be used, and what to do."""
    found, told = result.estimate, verdict(result)
    count = sum(1 for row in parameter_rows(found, units_of(result)) if row.status != "fixed")
    before, after = (_mean_fit(result, which) for which in ("start", "estimate"))
    where = "recordings that were not used" if result.validation else "the recordings that were used"
    happened = (
        f"{count} parameters of {found.model.joint} estimated: on {where} the mean fit goes from "
        f"{percent_text(before)} to {percent_text(after)} %."
    )
    bad = [sentence for status, sentence in told if status == "bad"]
    if bad:
        return "bad", f"{happened} {bad[0]}", "do not use these numbers; diagnose tells what is missing."
    if any(status == "fair" for status, _ in told):
        return "fair", happened, "model.yaml holds the estimate; read the notes below before you use it."
    if after < before:
        return "fair", happened, "the start was nearer: see where in the picture, with Difference."
    todo = "model.yaml holds the estimate: simulate with it"
    return "good", happened, f"{todo}{'' if result.validation else ', and judge it on another recording'}."


def _mean_fit(result: Result, which: str) -> float:
    """Mean fit of start or estimate over the signals of the recordings that judge, percent."""
    bags = [b for b in result.data if b in result.validation] or list(result.data)
    fits = [judged(result.fits[which, b].percent, hardly_moving([result.data[b]])) for b in bags]
    return float(np.mean([p for found in fits for p in found.values()]))


def _recording(report: Page, result: Result, bag: str) -> None:
    """The response to one recording, and what was done to that."""
    dataset, windows = result.data[bag], result.fits["estimate", bag].windows
    part = report.section(f"{bag} ({'validation' if bag in result.validation else 'estimation'})")
    part.plot(fit_picture(result, bag), f"Measured and simulated response, {bag}")
    samples = f"{len(dataset)} samples of {dataset.dt * 1e3:.3g} ms"
    part.text(f"{samples}; simulated {windows.extent} ({windows.why}).")
    for sentence in result.told[bag]:
        part.text(f"{sentence[0].upper()}{sentence[1:]}.")


def _correlation(report: Page, result: Result) -> None:
    unsure = result.estimate.uncertainty
    if unsure is None or len(unsure.names) < 2:
        return
    rows = [
        [name, *("–" if not np.isfinite(c) else f"{c:+.2f}" for c in line)]
        for name, line in zip(unsure.names, unsure.correlation, strict=True)
    ]
    text = "Near ±1 only a combination of the two is known well."
    report.section("Correlation of the estimates", text, folded=True).table(["", *unsure.names], rows)


def fit_picture(result: Result, bag: str) -> Plot:
    """Each output as measured, as the start and as the estimate simulate it, and the input."""
    dataset = result.data[bag]
    panels = []
    for signal, measured in dataset.signals().items():
        lines, fits = [Series("measured", dataset.time, measured)], []
        for which, role in (("start", "given"), ("estimate", "re-estimated")):
            fit = result.fits[which, bag]
            fits.append(f"{which} {percent_text(fit.percent[signal])} %")
            lines.append(Series(which, dataset.time, within(fit.simulated[signal], measured), role))
        panels.append(Panel(signal, dataset.units()[signal], lines, note=", ".join(fits)))
    panels.append(input_panel(dataset))
    return Plot(panels, "time since the recording's first sample (s)").with_difference()


__all__ = ["Result", "Row", "as_json", "fit_picture", "page", "residual_picture", "tables", "verdict"]
