"""A model to start from, out of recordings of one joint: its structure, and the parameters of that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.model import STRUCTURES, Model
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band, rate_of_readings
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import BRIDGED, banded
from haptic_teleop_sysid.estimation.excitation import refuse_idle
from haptic_teleop_sysid.estimation.records import Record, record_from
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.starting_model.flexible import flexible_joint
from haptic_teleop_sysid.starting_model.input_fits import ladder, motor_columns
from haptic_teleop_sysid.starting_model.rigid import rigid_body

#: Share of the motor's travel, and steps of the encoder, by which an arm must differ to be flexible.
_GIVES, _STEPS = 1e-3, 4.0
#: Share of the sampling rate at which the motion's band ends where noise, not motion, fills it; and the share
#: of the band that is used then.
_NOISY, _QUIET = 0.0999, 0.25
#: s, between samples, beyond which nobody records a joint.
_QUICKEST, _SLOWEST = 5e-6, 0.5


@dataclass(frozen=True)
class StartingModel:
    """``model``; ``std``: standard errors by parameter; ``percent``: fit of the input by the structure alone,
    100 (1 - rms left / rms about the mean); ``beside``: what else stood beside it, by name, with sizes, and
    ``percent_beside``; ``cutoff`` Hz; ``told``: what to know of it."""

    model: Model
    std: dict[str, float]
    percent: float
    beside: dict[str, float]
    percent_beside: float
    cutoff: float
    told: tuple[str, ...]


def starting_model(
    recordings: Mapping[str, Recording], joint: str, io: Mapping[str, Any], structure: str | None = None
) -> StartingModel:
    """Return a model of one joint from recordings by name. ``io``: its section of a model file, see
    `joints_in`; ``structure``: None for the one that fits what was recorded.

    Raises what `load_dataset` raises; ConfigurationError for a flexible joint without a recorded arm;
    MismatchError where the arm does not move as an arm; RecordingError where the inertia does not show.
    """
    if structure == "flexible_joint" and io.get("arm") is None:
        raise ConfigurationError(f"{joint} has no recorded arm: take --structure rigid_body, or record one.")
    told: list[str] = []
    kind = structure or ("rigid_body" if io.get("arm") is None else "flexible_joint")
    data = [load_dataset(r, _unit_model(joint, kind, io), n, allow_gaps=True) for n, r in recordings.items()]
    for dataset in data:
        refuse_idle(dataset)
        _refuse_another_time(dataset)
        told += [f"note: {dataset.name}: {problem}" for problem in dataset.problems]
    if structure is None and kind == "flexible_joint" and not any(_gives(d) for d in data):
        kind = "rigid_body"
        told.append("the arm does not move against its motor by more than the encoders show: a rigid body")
        io = {**io, "arm": None}
        data = [
            load_dataset(r, _unit_model(joint, kind, io), n, allow_gaps=True) for n, r in recordings.items()
        ]
    records = [record_from(d) for d in data]
    cutoff = _band(records)
    motions = [banded(r, kind == "rigid_body", cutoff) for r in records]
    if not any(len(m.kept) for m in motions):
        raise RecordingError(
            f"{data[0].name}: {joint} has no stretch without holes of more than "
            f"{1e3 * BRIDGED / cutoff:.3g} ms in its readings: record its angle more often."
        )
    unit = data[0].input_unit
    if unit not in ("N*m", "N"):
        told.append(f"the input is in {unit}: every parameter is per {unit} of it, with torque_constant 1")
    turns = data[0].position_unit == "rad"
    solve = rigid_body if kind == "rigid_body" else flexible_joint
    found = solve(motions, turns, joint, data[0].name)
    told += found.told
    plain, chosen = found.plain, found.chosen
    if chosen.beside:
        told.append(
            f"the structure alone explains {plain.percent:.3g} % of the input, too little to show its "
            f"parameters: they were found with {', '.join(chosen.beside)} beside it "
            f"({chosen.percent:.3g} %), which the model lacks"
        )
    richer = chosen if chosen.beside else ladder(motions, motor_columns(motions, kind), turns)[1]
    model = Model(
        "generic",
        joint,
        kind,
        {"torque_constant": 1.0} | found.values,
        fixed=("torque_constant",),
        io={**io, "arm": io.get("arm")},
    )
    sizes = richer.values[len(richer.values) - len(richer.beside) :]
    beside = dict(zip(richer.beside, (float(v) for v in sizes), strict=True))
    return StartingModel(model, found.std, plain.percent, beside, richer.percent, cutoff, tuple(told))


def _refuse_another_time(dataset: DataSet) -> None:
    """Raise RecordingError where samples lie so far apart, or so near, that no joint was recorded so."""
    if not _QUICKEST < dataset.dt < _SLOWEST:
        raise RecordingError(
            f"{dataset.name}: samples are {dataset.dt:.3g} s apart: is the time in another unit (ms, us)? "
            "`haptic-teleop import LOG --suggest` proposes a mapping that says so."
        )


def _band(records: Sequence[Record]) -> float:
    """The band of the motion, Hz; a quarter of it where noise fills it to its end."""
    band = motion_band(records)
    return _QUIET * band if band >= _NOISY * rate_of_readings(records) else band


def _unit_model(joint: str, structure: str, io: Mapping[str, Any]) -> Model:
    """A model that only says what is to be read."""
    return Model("generic", joint, structure, dict.fromkeys(STRUCTURES[structure], 1.0), io=dict(io))


def _gives(data: DataSet) -> bool:
    if data.arm_position is None:
        return False
    record = record_from(data)
    bend = data.motor_position - data.arm_position
    least = max(_STEPS * max(record.resolution), _GIVES * float(np.std(data.motor_position)))
    return float(np.std(bend)) > least
