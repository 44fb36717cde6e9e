"""Pictures of a scenario: command, motion, torque and current of one stage, several runs laid over each
other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.robots import OMNI_JOINTS
from haptic_teleop_sysid.report import Panel, Plot, Series, histogram
from haptic_teleop_sysid.report.plot import LESS
from haptic_teleop_sysid.report.roles import ROLES, RUNS
from haptic_teleop_sysid.verification.run import Run
from haptic_teleop_sysid.verification.signals import StageRun

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
#: Dashes of the speed that the force law promises, and of an arm where colours tell runs apart: dots, behind
#: the stroke of its run, or a stroke behind its dots.
_PROMISE, _DOTS, _STROKE = (3, 3), (2, 3), (10, 3)


def stage_picture(
    runs: Sequence[Run],
    stage: str,
    labels: Sequence[str],
    remove_delay: bool = False,
    roles: Sequence[str] = (),
) -> Plot:
    """Return the stage's panels over time; contact and release of the first run are shaded. Of several runs
    the difference to the first one can be shown instead.

    With `remove_delay` each run's time counts from the onset of its command. ``roles``: what each of several
    runs means, see `ROLES`; without them they are told apart by their order.
    """
    shown = [
        (run, label, roles[number] if roles else RUNS[number % len(RUNS)])
        for number, (run, label) in enumerate(zip(runs, labels, strict=True))
        if stage in run.stages
    ]
    single, first = len(shown) == 1, shown[0][0]
    merit, settings = first.merits[stage], first.stages[stage].settings
    lines = [
        _lines(run.stages[stage], run.onset if remove_delay else 0.0, "" if single else label, role)
        for run, label, role in shown
    ]
    shift = first.onset if remove_delay else 0.0
    spans = [(a - shift, b - shift) for kind, a, b in merit.phases if kind in ("contact", "release")]
    panels = [
        Panel(title, unit, [s for one in lines for s in one[key]], spans=spans)
        for key, (title, unit) in _titles(merit.of_omni, merit.unit).items()
    ]
    command, position, velocity, torque, current = panels
    data = first.stages[stage]
    time = data.time - shift
    if settings.lambda_:
        expected = data.desired_torque / settings.lambda_
        velocity = _with(velocity, Series("Td / λ", time, expected, "reference", _PROMISE))
    if single:
        torque = _with(torque, Series("Td", time, data.desired_torque, "reference"))
    # The wall is drawn where it was met: a line far away would only squeeze the others.
    walls = [contact.arm_position for contact in merit.contacts]
    position = _with(position, *(_level("wall", time, wall) for wall in walls))
    limit = settings.current_limit
    reached = max(float(np.nanmax(np.abs(run.stages[stage].current))) for run, _, _ in shown)
    if reached > 0.8 * limit:
        word = "torque limit" if merit.of_omni else "current limit"
        current = _with(current, *(_level(word, time, end) for end in (-limit, limit)))
    since = "the command's onset" if remove_delay else "the first sample"
    return Plot(
        [command, position, velocity, torque, current],
        f"time since {since} (s)",
        [] if single else _differences(panels, lines, "" if roles else shown[0][1]),
        difference_of=LESS if roles or single else f"each run less {shown[0][1]}",
    )


def _titles(of_omni: bool, unit: str) -> dict[str, tuple[str, str]]:
    """Title and unit of each panel, by what its lines are."""
    return {
        "command": ("Command: desired torque Td", "N·m"),
        "position": ("Position", "rad"),
        "velocity": ("Velocity", "rad/s"),
        "torque": (f"Torque on the environment Te{', estimated' * of_omni}", "N·m"),
        "current": ("Torque of the motor" if of_omni else "Current", unit),
    }


def _lines(data: StageRun, shift: float, label: str, role: str) -> dict[str, list[Series]]:
    """What one run shows in each panel; ``label``: of one among several, "" for a single one.

    A single run has a colour for each signal; of several each has a colour, and dots for its arm."""
    of_omni, single = data.stage in OMNI_JOINTS, not label
    time, name = data.time - shift, f"{label}: " if label else ""
    drive = "torque" if of_omni else "current"
    moving = f"{name}{'axis' if of_omni else 'motor'}"
    position = [Series(moving, time, data.arm_position if of_omni else data.motor_position, role)]
    if not of_omni:
        dash = ROLES[role].dash
        more = (*dash, *dash, *_STROKE) if dash == _DOTS else (*dash, *_DOTS, *_DOTS)
        arm, dots = ("second", None) if single else (role, more if dash else _DOTS)
        position.append(Series(f"{name}arm", time, data.arm_position, arm, dots))
    current = [Series(drive if single else moving, time, data.current, role)]
    if single and data.commanded_current is not None:
        current.append(Series(f"commanded {drive}", time, data.commanded_current, "input", (3, 3)))
    return {
        "command": [Series(f"{name}Td", time, data.desired_torque, "reference" if single else role)],
        "position": position,
        "velocity": [Series(moving, time, data.motor_velocity, role)],
        "torque": [Series("Te" if single else moving, time, data.environment_torque, role)],
        "current": current,
    }


def _with(panel: Panel, *more: Series) -> Panel:
    return replace(panel, series=[*panel.series, *more])


def _level(label: str, time: Array, value: float) -> Series:
    """A horizontal line over the whole time, of what ends motion or current."""
    return Series(label, time[[0, -1]], np.full(2, value), "alarm")


def _differences(
    panels: Sequence[Panel], lines: Sequence[dict[str, list[Series]]], first: str
) -> list[Panel]:
    """Each further run less the ``first`` one, at its own times within those of the first; without a name of
    that, which is then a measurement, the first less the others, which are simulations."""
    found, sign = [], 1.0 if first else -1.0
    for panel, key in zip(panels, lines[0], strict=True):
        apart = [
            replace(one, value=sign * (one.value - _at(base, one.time)))
            for other in lines[1:]
            for base, one in zip(lines[0][key], other[key], strict=True)
        ]
        what = f"less {first}" if first else LESS
        found.append(Panel(f"{panel.title}: {what}", panel.unit, apart, (0.0,), panel.spans))
    return found


def _at(series: Series, time: Array) -> Array:
    """The line at other times (n,); NaN outside its own."""
    return np.interp(time, series.time, series.value, np.nan, np.nan)


def latency_picture(runs: Sequence[Run], labels: Sequence[str]) -> Figure | None:
    """Return a histogram of the loop latency of each run, or None when no run tells it."""
    samples = [
        (label, 1e3 * run.latency) for run, label in zip(runs, labels, strict=True) if len(run.latency)
    ]
    if not samples:
        return None
    limit = max(float(np.percentile(values, 99.9)) for _, values in samples) * 1.2
    return histogram(
        samples,
        "from a state's stamp to its command's arrival (ms; what is later stands at the right edge)",
        limit,
    )
