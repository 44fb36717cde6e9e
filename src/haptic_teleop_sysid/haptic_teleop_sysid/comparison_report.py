"""How a comparison is shown: tables on the terminal, pictures, and the page."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from rich.table import Table
from rich.text import Text

from haptic_teleop_sysid.comparison import Comparison
from haptic_teleop_sysid.report import Page, Panel, Section, Series, stacked_panels
from haptic_teleop_sysid.residual_picture import residual_picture
from haptic_teleop_sysid.residuals import UNDER_FEEDBACK
from haptic_teleop_sysid.windows import closed_loop


def percent_text(value: float) -> str:
    """Return a fit as text: one decimal, a dash where there is none, and words for what exploded."""
    if np.isnan(value):
        return "–"
    return f"{value:.1f}" if value > -1e4 else "< −10000"


def comparison_table(result: Comparison) -> list[Table]:
    """Return one table per recording: models down, signals across, fit in percent."""
    tables = []
    for bag, dataset in result.data.items():
        signals = list(dataset.signals())
        chosen = result.windows[bag]
        extent = (
            "whole recording"
            if chosen.seconds is None
            else f"{len(chosen.spans)} windows of {chosen.seconds:.2f} s"
        )
        # Texts, not strings: brackets in a file name are no markup.
        table = Table(title=Text(f"{bag}: simulated fit in % ({extent}; {chosen.why})"), title_justify="left")
        table.add_column("model", overflow="fold")
        for signal in signals:
            # Two lines, so that a terminal of 80 columns does not cut what tells the columns apart.
            table.add_column(Text(signal.replace(".", "\n")), justify="right")
        for name in result.models:
            percent = result.fits[name, bag].percent
            table.add_row(
                Text(name), *(percent_text(percent.get(signal, float("nan"))) for signal in signals)
            )
        tables.append(table)
    return tables


def comparison_pictures(result: Comparison) -> dict[str, Figure]:
    """Return one figure per recording: each output as measured and as simulated by each model, and the
    input.
    """
    pictures = {}
    for bag, dataset in result.data.items():
        time = dataset.time
        panels = []
        for signal, measured in dataset.signals().items():
            lines = [Series("measured", time, measured, colour=0, width=1.8)]
            for number, name in enumerate(result.models, start=1):
                fit = result.fits[name, bag]
                if signal in fit.simulated:
                    label = f"{short(name, result)}  {percent_text(fit.percent[signal])} %"
                    lines.append(Series(label, time, within(fit.simulated[signal], measured), colour=number))
            panels.append(Panel(signal, dataset.units()[signal], lines))
        unit = dataset.input_unit.replace("*", "·")
        panels.append(
            Panel(
                f"input ({dataset.input_source})",
                unit,
                [Series("", time, dataset.input, colour=0, width=1.0)],
            )
        )
        pictures[bag] = stacked_panels(panels, x_label="time since the recording's first sample (s)")
    return pictures


def within(simulated: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return the simulated values, cut where a runaway response would flatten the measured one to a line."""
    low, high = float(np.min(measured)), float(np.max(measured))
    room = 1.5 * max(high - low, 1e-9)
    return np.where((simulated < low - room) | (simulated > high + room), np.nan, simulated)


def short(name: str, result: Comparison) -> str:
    """Return the shortest ending of a path that no other model shares."""
    parts = name.replace("\\", "/").split("/")
    for count in range(1, len(parts) + 1):
        ending = "/".join(parts[-count:])
        if sum(other == ending or other.endswith("/" + ending) for other in result.models) == 1:
            return ending
    return name


def comparison_page(result: Comparison, pictures: dict[str, Figure]) -> Page:
    """Return the report."""
    first = next(iter(result.models.values()))
    page = Page(
        "Models against recordings", f"{first.robot} {first.joint}: simulated response to the recorded input"
    )
    _summary(page, result)
    for bag, dataset in result.data.items():
        chosen = result.windows[bag]
        extent = "over the whole recording" if chosen.seconds is None else (
            f"over {len(chosen.spans)} consecutive windows of {chosen.seconds:.2f} s"
        )  # fmt: skip
        section = page.section(f"Recording {bag}")
        section.text(
            f"{len(dataset)} samples of {dataset.dt * 1e3:.3g} ms from {dataset.time[0]:.2f} to "
            f"{dataset.time[-1]:.2f} s. "
            f"The response is simulated {extent} ({chosen.why}); the initial state is estimated for each, "
            f"nothing is "
            "corrected along the way, and all models use the same."
        )
        for problem in dataset.problems:
            section.text(f"About the recording: {problem}.")
        signals, units = list(dataset.signals()), dataset.units()
        rows, errors = [], []
        for name in result.models:
            fit = result.fits[name, bag]
            rows.append([name, *(percent_text(fit.percent.get(signal, float("nan"))) for signal in signals)])
            errors.append([name, *(f"{fit.rms[s]:.4g}" if s in fit.rms else "–" for s in signals)])
        section.table(["model", *signals], rows, "Fit in percent: 100·(1 − ‖y − ŷ‖ / ‖y − mean y‖)")
        section.table(["model", *(f"{s} ({units[s]})" for s in signals)], errors, "Error, root mean square")
        section.picture(pictures[bag], f"Measured and simulated response, {bag}")
        _residuals(section, result, bag)
    _parameters(page, result)
    return page


def _residuals(section: Section, result: Comparison, bag: str) -> None:
    loop = closed_loop(result.data[bag])
    rows = [
        [short(name, result), r.signal, f"{r.rms:.3g}", *(f"{100 * share:.0f} %" for share in r.outside)]
        for name in result.models
        for r in result.residuals.get((name, bag), [])
    ]
    if not rows:
        return
    section.text(
        "One-step prediction errors, the noise levels tuned for each model: of a model that explains "
        "everything about "
        "1 % of the correlations lie beyond the 99 % bound."
        + (f" {UNDER_FEEDBACK}" if loop else "")
    )
    header = ["model", "encoder", "error (rad rms)", "with itself later, beyond", "with past inputs, beyond"]
    section.table(header, rows, "Residual analysis")
    for name in result.models:
        if found := result.residuals.get((name, bag)):
            title = f"Correlation of the one-step errors of {short(name, result)}, {bag}"
            section.picture(residual_picture(found, result.data[bag].dt), title)


def _summary(page: Page, result: Comparison) -> None:
    for bag in result.data:
        means = {name: np.mean(list(result.fits[name, bag].percent.values())) for name in result.models}
        best = max(means, key=lambda name: means[name] if np.isfinite(means[name]) else -np.inf)
        fits = ", ".join(
            f"{signal} {percent_text(value)} %" for signal, value in result.fits[best, bag].percent.items()
        )
        leading = (
            f"nearest to {bag} comes {short(best, result)}"
            if len(means) > 1
            else f"{short(best, result)} on {bag}"
        )
        page.verdict("plain", f"{leading[0].upper()}{leading[1:]}: {fits}.")
    for name, found in result.fitted.items():
        if found.converged:
            page.verdict(
                "plain",
                f"{short(name, result)}: free parameters fitted to {next(iter(result.data))} by least "
                f"squares.",
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
            page.verdict("fair", f"{bag}: {problem}.")


def _parameters(page: Page, result: Comparison) -> None:
    names = list(dict.fromkeys(key for model in result.models.values() for key in model.parameter_values()))
    rows = []
    for key in names:
        values = [model.parameter_values().get(key) for model in result.models.values()]
        rows.append([key, *("–" if value is None else f"{value:.6g}" for value in values)])
    header = ["parameter", *(short(name, result) for name in result.models)]
    page.section("Parameters").table(header, rows, "SI units")
