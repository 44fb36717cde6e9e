"""How a comparison is shown: tables on the terminal, and the page."""

from __future__ import annotations

import numpy as np

from haptic_teleop_sim.kernel.free_simulation import LONGEST
from haptic_teleop_sysid.estimation.residuals import UNDER_FEEDBACK
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.small_motion import hardly_moving, spread
from haptic_teleop_sysid.recordings.time_grid import period_text
from haptic_teleop_sysid.report import Page, Plot, unit_text
from haptic_teleop_sysid.report.terminal_table import TerminalTable
from haptic_teleop_sysid.runs.comparison import Comparison
from haptic_teleop_sysid.runs.comparison_pictures import percent_text, short, short_bag
from haptic_teleop_sysid.runs.comparison_verdict import conclusion
from haptic_teleop_sysid.runs.residual_picture import residual_picture
from haptic_teleop_sysid.simulation.windows import closed_loop


def comparison_table(result: Comparison) -> dict[str, TerminalTable]:
    """Return one table per recording, by what it is of: models down, signals across, fit in percent."""
    tables = {}
    for bag, dataset in result.data.items():
        signals = list(dataset.signals())
        chosen = result.windows[bag]
        extent = (
            "whole recording"
            if chosen.seconds is None
            else f"{len(chosen.spans)} windows of {chosen.seconds:.2f} s"
        )
        # Two lines, so that a terminal of 80 columns does not widen for what tells the columns apart.
        heads = [signal.replace(".", "\n") for signal in signals]
        fits = {name: result.fits[name, bag].percent for name in result.models}
        rows = [
            [short(name, result), *(percent_text(fit.get(signal, float("nan"))) for signal in signals)]
            for name, fit in fits.items()
        ]
        title = f"{bag}: simulated fit in % ({extent}; {chosen.why})"
        tables[title] = TerminalTable(("model", *heads), rows, heads)
    return tables


def comparison_page(result: Comparison, pictures: dict[str, Plot], command: str = "") -> Page:
    """Return the report; ``command``: what finds out why the nearest model does not follow."""
    first = next(iter(result.models.values()))
    page = Page(
        "Models against recordings", f"{first.robot} {first.joint}: simulated response to the recorded input"
    )
    page.conclude(*conclusion(result, command))
    _summary(page, result)
    for bag in result.data:
        _recording(page, result, bag, pictures[bag])
    _parameters(page, result)
    for bag in result.data:
        _residuals(page, result, bag)
    files = [(short(name, result), name) for name in result.models]
    files += [(short_bag(bag, result), bag) for bag in result.data]
    page.section("Files", folded=True).table(("here called", "file"), files)
    return page


def _recording(page: Page, result: Comparison, bag: str, picture: Plot) -> None:
    """The response to one recording: picture, fits, errors, and how it was simulated."""
    dataset, chosen = result.data[bag], result.windows[bag]
    section = page.section(f"Recording {short_bag(bag, result)}")
    section.plot(picture, f"Measured and simulated response, {short_bag(bag, result)}")
    signals, units = list(dataset.signals()), dataset.units()
    still = hardly_moving([dataset])
    moves = [
        f"{spread(v):.3g} {units[s]}{' (hardly moves)' if s in still else ''}"
        for s, v in dataset.signals().items()
    ]
    rows, errors = [["(the recording moves by)", *moves]], []
    for name in result.models:
        fit = result.fits[name, bag]
        called, nan = short(name, result), float("nan")
        rows.append([called, *(percent_text(fit.percent.get(signal, nan)) for signal in signals)])
        errors.append([called, *(f"{fit.rms[s]:.4g}" if s in fit.rms else "–" for s in signals)])
    section.table(["model", *signals], rows, "Fit in percent: 100·(1 − ‖y − ŷ‖ / ‖y − mean y‖)")
    section.table(["model", *(f"{s} ({units[s]})" for s in signals)], errors, "Error, root mean square")
    limited = ""
    if max(stop - start for start, stop in chosen.spans) > LONGEST:
        limited = f"by its first {LONGEST} samples, "
    section.text(
        f"{len(dataset)} samples of {period_text(dataset.dt)} from {dataset.time[0]:.2f} to "
        f"{dataset.time[-1]:.2f} s. "
        f"The response is simulated {chosen.extent} ({chosen.why}); the initial state is estimated for each, "
        f"{limited}nothing is corrected along the way, and all models use the same."
    )


def _residuals(page: Page, result: Comparison, bag: str) -> None:
    loop = closed_loop(result.data[bag])
    rows = [
        [short(name, result), r.signal, f"{r.rms:.3g}", *(f"{100 * share:.0f} %" for share in r.outside)]
        for name in result.models
        for r in result.residuals.get((name, bag), [])
    ]
    if not rows:
        return
    section = page.section(
        f"One-step errors, {short_bag(bag, result)}",
        "One-step prediction errors, the noise levels tuned for each model: of a model that explains "
        "everything about "
        "1 % of the correlations lie beyond the 99 % bound." + (f" {UNDER_FEEDBACK}" if loop else ""),
        folded=True,
    )
    header = ["model", "encoder", "error (rad rms)", "with itself later, beyond", "with past inputs, beyond"]
    section.table(header, rows, "Residual analysis")
    for name in result.models:
        if found := result.residuals.get((name, bag)):
            title = f"Correlation of the one-step errors of {short(name, result)}, {short_bag(bag, result)}"
            section.plot(residual_picture(found, result.data[bag].dt), title)


def _summary(page: Page, result: Comparison) -> None:
    for bag in result.data:
        means = {name: np.mean(list(result.fits[name, bag].percent.values())) for name in result.models}
        best = max(means, key=lambda name: means[name] if np.isfinite(means[name]) else -np.inf)
        fits = ", ".join(
            f"{signal} {percent_text(value)} %" for signal, value in result.fits[best, bag].percent.items()
        )
        page.verdict("plain", f"{short_bag(bag, result)}: {short(best, result)}: {fits}.")
    for name, found in result.fitted.items():
        if found.converged:
            page.verdict(
                "plain",
                f"{short(name, result)}: free parameters fitted to "
                f"{short_bag(next(iter(result.data)), result)} by least squares.",
            )
        else:
            page.verdict(
                "fair",
                f"{short(name, result)}: the least-squares search stopped at its limit of "
                f"{found.evaluations} evaluations; its parameters are not the best.",
            )
        for parameter in found.fled:
            page.verdict(
                "fair",
                f"{short(name, result)}: {parameter} fled to {found.model.parameters[parameter]:.3g}; the "
                f"structure "
                "cannot follow the recording, and that number means nothing.",
            )
    for bag, dataset in result.data.items():
        for problem in dataset.problems:
            page.verdict("fair", f"{short_bag(bag, result)}: {problem}.")


def _parameters(page: Page, result: Comparison) -> None:
    """The numbers of all models with their units; a model file holds no standard errors."""
    dataset = next(iter(result.data.values()))
    names = list(dict.fromkeys(key for model in result.models.values() for key in model.parameter_values()))
    rows = []
    for key in names:
        holder = next(m for m in result.models.values() if key in m.parameter_values())
        values = [model.parameter_values().get(key) for model in result.models.values()]
        unit = unit_text(Units.of(holder, dataset).of_parameter(holder, key))
        rows.append([key, unit, *("–" if value is None else f"{value:.6g}" for value in values)])
    header = ["parameter", "unit", *(short(name, result) for name in result.models)]
    page.section("Parameters").table(
        header,
        rows,
        "As the model files state them. A model file holds no standard errors: those of an estimated one "
        "stand in estimate.json and report.html, beside its model.yaml.",
    )
