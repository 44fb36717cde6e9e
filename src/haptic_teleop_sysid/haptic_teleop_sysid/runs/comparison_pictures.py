"""The pictures of a comparison: what was measured over what each model says."""

from __future__ import annotations

import numpy as np

from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.report import Panel, Plot, Series, unit_text
from haptic_teleop_sysid.report.endings import shortest_ending
from haptic_teleop_sysid.report.roles import model_roles
from haptic_teleop_sysid.runs.comparison import Comparison
from haptic_teleop_sysid.runs.told_roles import told_role


def percent_text(value: float) -> str:
    """Return a fit as text: one decimal, a dash where there is none, and words for what exploded."""
    if np.isnan(value):
        return "–"
    return f"{value:.1f}" if value > -1e4 else "< −10000"


def comparison_pictures(result: Comparison) -> dict[str, Plot]:
    """Return one plot per recording: each output as measured and as simulated by each model, and the
    input.
    """
    pictures = {}
    roles = roles_of(result)
    for bag, dataset in result.data.items():
        time = dataset.time
        panels = []
        for signal, measured in dataset.signals().items():
            lines, fits = [Series("measured", time, measured)], []
            for name in result.models:
                fit = result.fits[name, bag]
                if signal in fit.simulated:
                    label = short(name, result)
                    fits.append(f"{label} {percent_text(fit.percent[signal])} %")
                    lines.append(Series(label, time, within(fit.simulated[signal], measured), roles[name]))
            panels.append(Panel(signal, dataset.units()[signal], lines, note=", ".join(fits)))
        panels.append(input_panel(dataset))
        pictures[bag] = Plot(panels, "time since the recording's first sample (s)").with_difference()
    return pictures


def input_panel(dataset: DataSet) -> Panel:
    """The input of a data set."""
    line = Series("input", dataset.time, dataset.input, "input")
    return Panel(f"input ({dataset.input_source})", unit_text(dataset.input_unit), [line])


def roles_of(result: Comparison) -> dict[str, str]:
    """What each model means, as `ROLES` has it: by what its file says of itself, else by its effects."""
    effects = [len(model.effects) for model in result.models.values()]
    told = [told_role(name) for name in result.models]
    return dict(zip(result.models, model_roles(effects, told), strict=True))


def within(simulated: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Return the simulated values, cut where a runaway response would flatten the measured one to a line."""
    low, high = float(np.min(measured)), float(np.max(measured))
    room = 1.5 * max(high - low, 1e-9)
    return np.where((simulated < low - room) | (simulated > high + room), np.nan, simulated)


def short(name: str, result: Comparison) -> str:
    """Return a model's path by its shortest ending."""
    return shortest_ending(name, result.models)


def short_bag(bag: str, result: Comparison) -> str:
    """Return a recording's path by its shortest ending."""
    return shortest_ending(bag, result.data)
