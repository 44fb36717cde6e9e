"""How an estimate is shown: tables on the terminal, page with pictures, estimate.json."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from haptic_teleop_sysid.estimation.residuals import reading
from haptic_teleop_sysid.recordings.time_grid import period_text
from haptic_teleop_sysid.report import Page, Panel, Plot, Series
from haptic_teleop_sysid.report.terminal_table import TerminalTable
from haptic_teleop_sysid.runs.comparison_pictures import input_panel, percent_text, within
from haptic_teleop_sysid.runs.estimation_doubts import doubts
from haptic_teleop_sysid.runs.estimation_result import Result
from haptic_teleop_sysid.runs.estimation_verdict import (
    Commands,
    conclusion,
    is_doubted,
    notes,
    problems,
    rows_of,
)
from haptic_teleop_sysid.runs.parameter_table import HEADER, as_text, caption, remark
from haptic_teleop_sysid.runs.residual_picture import residual_picture
from haptic_teleop_sysid.simulation.windows import closed_loop

_SHOWN = ("parameter", "estimate", "std. error", "unit", "remark")


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
        "parameters": [asdict(row) for row in rows_of(result)],
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
        "problems": [asdict(problem) for problem in problems(result)],
        "doubts": [asdict(doubt) for doubt in doubts(result)],
        "kept_starts": list(found.kept),
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


def tables(result: Result) -> list[TerminalTable]:
    """Parameters, and fits of start and estimate on all recordings, for the terminal."""
    found = []
    for row in rows_of(result):
        cells = dict(zip(HEADER, as_text(row), strict=True)) | {"remark": remark(row, in_full=False)}
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


def page(result: Result, commands: Commands | None = None) -> Page:
    """The report; ``commands``: what to paste after it."""
    found = result.estimate
    report = Page("Estimated parameters", f"{found.model.robot} {found.model.joint}, {found.method}")
    report.conclude(*conclusion(result, commands or Commands()))
    told = problems(result)
    for problem in told[1:]:
        report.verdict("bad", problem.headline)
    for status, sentence in notes(result):
        report.verdict(status, sentence)
    report.section("Parameters").table(
        HEADER, [as_text(row) for row in rows_of(result)], caption(is_doubted(result))
    )
    if any(problem.details for problem in told):
        why = report.section("Why these parameters do not hold", folded=True)
        for problem in told:
            for sentence in problem.details:
                why.text(sentence)
    section = report.section(
        "Fit",
        "Simulated response to the recorded input, 100·(1 − ‖y − ŷ‖ / ‖y − mean y‖); "
        "initial state estimated for each window, nothing corrected along the way.",
    )
    section.table(["recording", "signal", "start", "estimate"], fit_rows(result), "in percent")
    for bag in result.data:
        _recording(report, result, bag)
    _correlation(report, result)
    for bag, dataset in result.data.items():
        residuals = result.residuals.get(bag, [])
        if residuals:
            part = report.section(f"One-step errors, {bag}", folded=True)
            for sentence in reading(residuals, closed_loop(dataset)):
                part.text(sentence)
            part.plot(
                residual_picture(residuals, dataset.dt),
                f"Correlation of the one-step prediction errors, {bag}",
            )
    return report


def _recording(report: Page, result: Result, bag: str) -> None:
    """The response to one recording, and what was done to that."""
    dataset, windows = result.data[bag], result.fits["estimate", bag].windows
    part = report.section(f"{bag} ({'validation' if bag in result.validation else 'estimation'})")
    part.plot(fit_picture(result, bag), f"Measured and simulated response, {bag}")
    samples = f"{len(dataset)} samples of {period_text(dataset.dt)}"
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
    report.section("Correlation of the estimates", text, folded=True).table(["with", *unsure.names], rows)


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
