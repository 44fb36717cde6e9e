"""Simulation and recording of one scenario, laid over each other (thesis 4.4, 5.4): every signal that both
hold, its fit in percent, with or without the delay between the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_control.robots import PAIRS
from haptic_teleop_sysid.recordings.small_motion import SMALLEST_SPREAD, spread
from haptic_teleop_sysid.simulation.fit import fit_percent
from haptic_teleop_sysid.verification.signals import MASTER_TOPIC, REFERENCE_TOPIC, STATE_TOPIC
from haptic_teleop_sysid.verification.simulation import SimulatedRun

Array = NDArray[np.float64]
ONSET_SHARE = 0.02
"""A command has begun when it is this share of its greatest change away from where it was."""


@dataclass(frozen=True)
class Comparison:
    """One signal of a group ("stage 1", "omni y"). time s and both values, (n,); fit in percent, None for a
    signal that hardly varies."""

    group: str
    name: str
    unit: str
    time: Array
    recorded: Array
    simulated: Array
    fit: float | None


@dataclass(frozen=True)
class Overlay:
    """delay: s by which the recording's command begins later than the simulation's; removed: whether it was
    taken out before the signals were compared."""

    comparisons: list[Comparison]
    delay: float
    removed: bool
    command: str
    plants: str

    def as_json(self) -> dict[str, Any]:
        """Return delay, sources and fit in percent by group and signal, as plain data."""
        fits: dict[str, dict[str, float | None]] = {}
        for one in self.comparisons:
            fits.setdefault(one.group, {})[one.name] = one.fit
        return {
            "delay_s": self.delay,
            "delay_removed": self.removed,
            "command": self.command,
            "plants": self.plants,
            "fit_percent": fits,
        }


def signals_of() -> list[tuple[str, str, str, str, str, str]]:
    """Return (group, name, unit, topic, joint, field) of every signal that is compared."""
    found = []
    for stage, axis in PAIRS.items():
        group = stage.replace("stage", "stage ")
        motor, arm = f"{stage}_motor", f"{stage}_arm"
        found += [
            (group, "motor position", "rad", STATE_TOPIC, motor, "position"),
            (group, "arm position", "rad", STATE_TOPIC, arm, "position"),
            (group, "motor velocity", "rad/s", STATE_TOPIC, motor, "velocity"),
            (group, "environment torque", "N·m", STATE_TOPIC, arm, "effort"),
            (group, "motor effort", "N·m", STATE_TOPIC, motor, "effort"),
        ]
        group = axis.replace("_", " ")
        found += [
            (group, "position", "rad", MASTER_TOPIC, axis, "position"),
            (group, "velocity", "rad/s", MASTER_TOPIC, axis, "velocity"),
            (group, "effort", "N·m", MASTER_TOPIC, axis, "effort"),
        ]
    return found


def overlay(recording: Recording, simulated: SimulatedRun, remove_delay: bool = False) -> Overlay:
    """Lay `simulated` over `recording`: both count from their first state of the 2DSFJ, or, with
    `remove_delay`, from the onset of their command.

    The simulation is interpolated to the recording's sampling times.
    """
    other = simulated.recording
    begin, other_begin = (one.topic(STATE_TOPIC).stamp[0] for one in (recording, other))
    delay = _onset(recording, int(begin)) - _onset(other, int(other_begin))
    shift = delay if remove_delay else 0.0
    found = []
    for group, name, unit, topic, joint, field in signals_of():
        measuring = _signal(recording.topics.get(topic), joint, field, int(begin))
        simulating = _signal(other.topics.get(topic), joint, field, int(other_begin))
        if measuring is None or simulating is None:
            continue
        (time, measured), (times, values) = measuring, simulating
        inside = (time - shift >= times[0]) & (time - shift <= times[-1])
        if np.count_nonzero(inside) < 10:
            continue
        time, measured = time[inside], measured[inside]
        model = np.interp(time - shift, times, values)
        fit = fit_percent(measured, model) if spread(measured) >= SMALLEST_SPREAD[unit] else None
        found.append(Comparison(group, name, unit, time - shift, measured, model, fit))
    return Overlay(found, delay, remove_delay, simulated.command, simulated.plants)


def _signal(
    series: JointStateSeries | None, joint: str, field: str, begin: int
) -> tuple[Array, Array] | None:
    if series is None or joint not in series.names or getattr(series, field) is None or len(series) < 2:
        return None
    values = series.signal(joint, field)
    keep = np.isfinite(values)
    time = (series.stamp[keep] - begin).astype(np.float64) * 1e-9
    order = np.argsort(time, kind="stable")
    return time[order], values[keep][order]


def _onset(recording: Recording, begin: int) -> float:
    """s at which the command first moves; the device's own motion where there was no artificial one."""
    for topic in (REFERENCE_TOPIC, MASTER_TOPIC):
        series = recording.topics.get(topic)
        if series is None or len(series) < 2:
            continue
        values = series.position if series.position is not None else series.effort
        if values is None:
            continue
        moved = np.max(np.abs(values - values[0]), axis=1)
        greatest = float(np.nanmax(moved))
        if greatest > 0.0:
            return float((series.stamp[int(np.argmax(moved > ONSET_SHARE * greatest))] - begin) * 1e-9)
    return 0.0
