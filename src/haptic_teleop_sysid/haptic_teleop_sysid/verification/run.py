"""One recording of a scenario, examined; and how far two recordings of one scenario agree."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from haptic_teleop_control.recording import Recording
from haptic_teleop_control.teleoperation.recorded_energy import PortEnergy, port_energies
from haptic_teleop_sysid.recordings.recorded_parameters import recorded_text
from haptic_teleop_sysid.simulation.fit import fit_percent
from haptic_teleop_sysid.verification.clock import read_clock
from haptic_teleop_sysid.verification.faults import Fault, find_faults
from haptic_teleop_sysid.verification.machine import Machine, read_machine
from haptic_teleop_sysid.verification.merit import StageMerit, stage_merit
from haptic_teleop_sysid.verification.settings import CONTROLLER
from haptic_teleop_sysid.verification.signals import STATE_TOPIC, StageRun, read_stages
from haptic_teleop_sysid.verification.slave_axes import STATE_TOPIC as OMNI_STATES
from haptic_teleop_sysid.verification.slave_axes import read_axes
from haptic_teleop_sysid.verification.timing import graph_health, latency_samples

COMPARED = ("motor_position", "arm_position", "motor_velocity", "environment_torque")


@dataclass(frozen=True)
class Run:
    """Everything that is known of one recording. `onset`: when the first command began, s of its time."""

    name: str
    stages: dict[str, StageRun]
    merits: dict[str, StageMerit]
    graph: dict[str, Any]
    latency: np.ndarray
    onset: float
    complete: bool
    problems: list[str]
    experiment: dict[str, Any]
    scenario: int = 1
    """2: the Omni is the slave; its axes stand in place of the stages, with the controller's estimate of the
    torque on the environment, because it has no force sensor."""
    energies: dict[str, PortEnergy] = field(default_factory=dict)
    """Of the ports "master" and "slave", as far as the recording holds their robots."""
    faults: list[Fault] = field(default_factory=list)
    cut_off: str = ""
    """What is missing of a scenario that did not come to its end without a fault; else empty."""
    machine: Machine = field(default_factory=Machine)

    @property
    def failed(self) -> bool:
        """Whether it holds a fault, is damaged or was cut off, or a stage oscillates."""
        oscillates = any(merit.oscillation is not None for merit in self.merits.values())
        return bool(self.faults or self.cut_off) or not self.complete or oscillates

    def as_json(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return {
            "failed": self.failed,
            "faults": [fault.as_json() for fault in self.faults],
            "stages": {stage: merit.as_json() for stage, merit in self.merits.items()},
            "graph": self.graph,
            "machine": self.machine.as_json(),
            "command_onset_s": self.onset,
            "cut_off": self.cut_off,
            "complete": self.complete,
            "problems": self.problems,
            "experiment": self.experiment,
            "energy_j": {
                port: {"end": one.energy[-1].tolist(), "lowest": one.lowest.tolist()}
                for port, one in self.energies.items()
            },
        }


def examine(
    recording: Recording, name: str, overrides: Mapping[str, Mapping[str, float]] | None = None
) -> Run:
    """Return the examined recording. `overrides`: stage -> setting -> value, see `StageSettings`.

    Raises MismatchError when it is no recording of a scenario or does not say enough about itself.
    """
    second = recorded_text(recording.parameters, "slave", CONTROLLER) == "omni"
    stages = (read_axes if second else read_stages)(recording, name, overrides)
    by_hand = recorded_text(recording.parameters, "command_source", CONTROLLER) == "device"
    merits = {stage: stage_merit(run, by_hand) for stage, run in stages.items()}
    own_time = read_clock(recording)
    graph = graph_health(recording, own_time)
    topic = OMNI_STATES if second else STATE_TOPIC
    clock = recording.topics[topic] if topic in recording.topics else next(iter(recording.topics.values()))
    begins = [
        start for merit in merits.values() for kind, start, _ in merit.phases if kind in ("free", "contact")
    ]
    start, end = int(clock.stamp[0]), int(clock.stamp[-1])
    faults = find_faults(recording, start, end)
    return Run(
        name=name,
        stages=stages,
        merits=merits,
        graph=graph,
        latency=latency_samples(recording, own_time),
        onset=min(begins, default=0.0),
        complete=recording.complete,
        problems=list(recording.problems),
        experiment=dict(recording.experiment),
        scenario=2 if second else 1,
        faults=faults,
        cut_off="" if faults else _cut_off(recording, 1e-9 * (end - start)),
        machine=read_machine(graph, recording.diagnostics, own_time),
        energies=port_energies(recording.topics, *(("sfj", "omni") if second else ("omni", "sfj"))),
    )


def _cut_off(recording: Recording, seconds: float) -> str:
    """What is missing of a scenario that was stopped before its end, or whose recorder was."""
    try:
        planned = float(recording.experiment.get("planned_duration", 0.0))
    except (TypeError, ValueError):
        return ""
    if not 0.0 < planned < math.inf or recording.reception.get("ended"):
        return ""
    return f"cut off after {seconds:.1f} of {planned:g} s"


def agreement(first: Run, second: Run) -> dict[str, dict[str, float]]:
    """Return stage -> signal -> fit in percent of the second run to the first, both counted from their
    command's onset.
    """
    result: dict[str, dict[str, float]] = {}
    for stage in first.stages.keys() & second.stages.keys():
        a, b = first.stages[stage], second.stages[stage]
        time_a, time_b = a.time - first.onset, b.time - second.onset
        common = (time_a >= max(time_a[0], time_b[0])) & (time_a <= min(time_a[-1], time_b[-1]))
        if np.count_nonzero(common) < 10:
            continue
        result[stage] = {}
        for signal in COMPARED:
            other = np.interp(time_a[common], time_b, getattr(b, signal))
            result[stage][signal] = fit_percent(getattr(a, signal)[common], other)
    return dict(sorted(result.items()))
