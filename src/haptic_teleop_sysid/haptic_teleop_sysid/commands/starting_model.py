"""A model to start from: structure and parameters by band-limited least squares on the equations of motion.

    rigid body:      J a + b v = u
    flexible joint:  q_m - q_a = (J_a / k) a_a + (b_a / k) v_a,   then   J_m a_m + b_m v_m + k (q_m - q_a) = u

linear in the parameters, after one zero-phase low pass on every term (Swevers, Verdonck and De Schutter,
IEEE Control Systems 27(5), 2007). The input is taken as it is: u in N·m, N, A, V or pu, and every parameter
is per that unit. Where the structure alone explains little, torques that real joints have (dry friction, a
constant, gravity) stand beside it, so that the inertia does not have to explain them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError, MismatchError, RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.model import STRUCTURES, Model
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band, rate_of_readings
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.groups import independent
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import BRIDGED, BandedMotion, banded
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.products import solved
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.regression import standard_errors
from haptic_teleop_sysid.estimation.excitation import refuse_idle
from haptic_teleop_sysid.estimation.records import Record, record_from
from haptic_teleop_sysid.logs.convert import ARM
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset

FloatArray = NDArray[np.float64]
#: Share of the motor's travel, and steps of the encoder, by which an arm must differ to be flexible.
_GIVES, _STEPS = 1e-3, 4.0
#: Velocity, relative to its rms, within which dry friction turns.
_TURNS = 0.02
#: Standard error, relative to the value, from which a parameter is not seen.
_UNSEEN = 0.5
#: Damping that a model has which no recording shows, as a share of the one that would take all of the input.
_LITTLE = 0.05
#: Fit of the input, %, below which a structure alone does not say what its parameters are.
_EXPLAINS = 50.0
#: Factor by which a plain fit may leave more of the input than the fullest does, and fit from which it may
#: anyhow: otherwise its parameters stand for what it lacks.
_LEAVES, _NEARLY_ALL = 2.0, 90.0
#: Share of the sampling rate at which the motion's band ends where noise, not motion, fills it.
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


@dataclass(frozen=True)
class _Fit:
    """Least squares of the input: ``values`` and ``errors`` of all columns, fit in ``percent``; ``beside``:
    the names of the columns behind the structure's."""

    values: FloatArray
    errors: FloatArray
    percent: float
    beside: tuple[str, ...]

    def seen(self, count: int) -> bool:
        """Whether the first ``count`` values are all known better than to _UNSEEN."""
        return bool(np.all(self.errors[:count] < _UNSEEN * self.values[:count]))


def joints_in(recording: Recording, name: str) -> dict[str, dict[str, Any]]:
    """Return the io section of each joint that a recording can give a model of: those that an import states,
    else every joint with positions and efforts; a joint `j_arm` is the arm of `j` or of `j_motor`.

    Raises RecordingError when there is none.
    """
    story = recording.experiment.get("import")
    if isinstance(story, Mapping) and isinstance(story.get("io"), Mapping):
        stated = {j: dict(io) for j, io in story["io"].items() if io.get("input")}
        if not stated:
            raise RecordingError(
                f"{name} has no input beside its positions, and a model needs both: name the column of the "
                "torque, current, voltage or command in the mapping."
            )
        return stated
    found: dict[str, dict[str, Any]] = {}
    for topic, series in recording.topics.items():
        if series.position is None or series.effort is None:
            continue
        for joint in series.names:
            stem = joint.removesuffix("_motor")
            if joint.endswith(ARM) and joint.removesuffix(ARM) in {
                n.removesuffix("_motor") for n in series.names
            }:
                continue
            if not np.any(np.isfinite(series.signal(joint, "effort"))):
                continue
            arm = {"topic": topic, "joint": stem + ARM} if stem + ARM in series.names else None
            found[stem] = {
                "input": {"topic": topic, "joint": joint, "field": "effort"},
                "motor": {"topic": topic, "joint": joint},
                "arm": arm,
            }
    if not found:
        raise RecordingError(f"{name} has no joint with positions and efforts: record or import both.")
    return found


def starting_model(
    recordings: Mapping[str, Recording], joint: str, io: Mapping[str, Any], structure: str | None = None
) -> StartingModel:
    """Return a model of one joint from recordings by name. ``structure``: None for the one that fits what was
    recorded.

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
    solve = _rigid if kind == "rigid_body" else _flexible
    plain, chosen, values, std = solve(motions, turns, joint, data[0].name, told)
    if chosen.beside:
        told.append(
            f"the structure alone explains {plain.percent:.3g} % of the input, too little to show its "
            f"parameters: they were found with {', '.join(chosen.beside)} beside it "
            f"({chosen.percent:.3g} %), which the model lacks"
        )
    richer = chosen if chosen.beside else _ladder(motions, _motor_columns(motions, kind), turns)[1]
    model = Model(
        "generic",
        joint,
        kind,
        {"torque_constant": 1.0} | values,
        fixed=("torque_constant",),
        io={**io, "arm": io.get("arm")},
    )
    sizes = richer.values[len(richer.values) - len(richer.beside) :]
    beside = dict(zip(richer.beside, (float(v) for v in sizes), strict=True))
    return StartingModel(model, std, plain.percent, beside, richer.percent, cutoff, tuple(told))


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


def _rows(
    motions: Sequence[BandedMotion], pick: Callable[[BandedMotion], FloatArray], times: int = 1
) -> FloatArray:
    return np.concatenate([m.filtered(pick(m), times) for m in motions])


def _motor_columns(motions: Sequence[BandedMotion], structure: str) -> FloatArray:
    """Columns (m, 2 or 3) of the motor's equation: acceleration, velocity, and deflection."""
    found = [_rows(motions, lambda m: m.acceleration[:, 0]), _rows(motions, lambda m: m.velocity[:, 0])]
    if structure != "rigid_body":
        found.append(_bend(motions))
    return np.column_stack(found)


def _taking_all(motions: Sequence[BandedMotion]) -> float:
    """The damping that would take all of the input, in its unit, s/rad."""
    drive, velocity = (_rows(motions, pick) for pick in (lambda m: m.input, lambda m: m.velocity[:, 0]))
    return float(np.std(drive) / max(float(np.std(velocity)), 1e-300))


def _bend(motions: Sequence[BandedMotion]) -> FloatArray:
    """Deflection (m,) about its mean: encoders of motor and arm may count from different zeros, and what
    holds a mean is the constant's."""
    found = _rows(motions, lambda m: m.angle[:, 0] - m.angle[:, 1])
    return found - np.mean(found)


def _ladder(motions: Sequence[BandedMotion], columns: FloatArray, turns: bool) -> list[_Fit]:
    """Fits of the input: by the columns alone, with dry friction and a constant, and with gravity (for a
    linear axis a spring) as well."""
    target = _rows(motions, lambda m: m.input)
    spread = max(float(np.std(np.concatenate([m.velocity[:, 0] for m in motions]))), 1e-300)
    dry = _rows(motions, lambda m: np.tanh(m.velocity[:, 0] / (_TURNS * spread)), 2)
    friction = np.column_stack([dry, np.ones_like(dry)])
    if turns:
        pull = [
            _rows(motions, lambda m: np.sin(m.angle[:, 0]), 2),
            _rows(motions, lambda m: np.cos(m.angle[:, 0]), 2),
        ]
        names = ("gravity (sine)", "gravity (cosine)")
    else:
        pull, names = [_rows(motions, lambda m: m.angle[:, 0])], ("spring",)
    count = columns.shape[1]
    steps = [
        ((), columns),
        (("dry friction", "a constant"), np.column_stack([columns, friction])),
        (("dry friction", "a constant", *names), np.column_stack([columns, friction, *pull])),
    ]
    # Dry friction, too, is none below zero.
    return [_fitted(every, target, count + bool(beside), beside) for beside, every in steps]


def _chosen(fits: Sequence[_Fit], count: int) -> _Fit:
    """The plainest fit that explains the input about as well as any and shows the first ``count`` parameters,
    else the one that explains most."""
    most = max(f.percent for f in fits)
    enough = max(_EXPLAINS, min(100.0 - _LEAVES * (100.0 - most), _NEARLY_ALL))
    good = [f for f in fits if f.percent > enough and f.seen(count)]
    return good[0] if good else max(fits, key=lambda f: f.percent)


def _rigid(
    motions: Sequence[BandedMotion], turns: bool, joint: str, recording: str, told: list[str]
) -> tuple[_Fit, _Fit, dict[str, float], dict[str, float]]:
    fits = _ladder(motions, _motor_columns(motions, "rigid_body"), turns)
    chosen = _chosen(fits, 1)
    if not chosen.seen(1) and chosen.percent > _EXPLAINS:
        # Slow motion against friction, which is none below zero, so that signs are right: the inertia is what
        # it may be at most, and the search goes from there.
        most = float(chosen.values[0] + 2.0 * chosen.errors[0])
        told.append(
            f"the inertia does not show in this motion: it is below about {most:.2g}, which the model has; "
            "a faster motion shows it"
        )
        chosen = replace(chosen, values=np.concatenate([[most], chosen.values[1:]]))
    else:
        _refuse_unseen(chosen, joint, recording)
    if not chosen.errors[1] < _UNSEEN * chosen.values[1]:
        little = _LITTLE * _taking_all(motions)
        seen = "motor_damping is hardly seen in this motion"
        if chosen.values[1] < little:
            # Searches go up to some times what a model has: from next to none they would not get anywhere.
            chosen = replace(chosen, values=np.concatenate([[chosen.values[0], little], chosen.values[2:]]))
            seen += f": the model has {100 * _LITTLE:.0f} % of what would take all of the input"
        told.append(seen)
    names = ("motor_inertia", "motor_damping")
    values, std = (
        {n: float(v) for n, v in zip(names, of, strict=False)} for of in (chosen.values, chosen.errors)
    )
    return fits[0], chosen, values, std


def _flexible(
    motions: Sequence[BandedMotion], turns: bool, joint: str, recording: str, told: list[str]
) -> tuple[_Fit, _Fit, dict[str, float], dict[str, float]]:
    bend = _bend(motions)
    arm = np.column_stack(
        [_rows(motions, lambda m: m.acceleration[:, 1]), _rows(motions, lambda m: m.velocity[:, 1])]
    )
    ratio = _fitted(arm, bend, 2, ())
    if not ratio.seen(1):
        raise MismatchError(
            f"{recording}: the arm of {joint} does not bend its joint as an inertia on a spring does "
            f"({ratio.percent:.3g} % explained): are its sign and unit right? Otherwise take "
            "--structure rigid_body."
        )
    fits = _ladder(motions, _motor_columns(motions, "flexible_joint"), turns)
    chosen = _chosen(fits, 3)
    per_stiffness, rub = (float(v) for v in ratio.values)
    doubt = float(ratio.errors[0]) / per_stiffness
    if chosen.seen(1) and chosen.errors[2] < _UNSEEN * chosen.values[2]:
        inertia, damping, stiffness = (float(v) for v in chosen.values[:3])
        errors = [float(e) for e in chosen.errors[:3]]
        arm_inertia = stiffness * per_stiffness
        arm_error = arm_inertia * float(np.hypot(errors[2] / stiffness, doubt))
    else:
        fits = _ladder(motions, _motor_columns(motions, "rigid_body"), turns)
        chosen = _chosen(fits, 1)
        _refuse_unseen(chosen, joint, recording)
        inertia = arm_inertia = 0.5 * float(chosen.values[0])
        stiffness, damping = arm_inertia / per_stiffness, float(chosen.values[1])
        arm_error = 0.5 * float(chosen.errors[0])
        errors = [arm_error, float(chosen.errors[1]), stiffness * doubt]
        told.append(
            "this motion does not tell the motor's inertia from the arm's: their sum was halved, and the "
            "stiffness follows from the natural frequency of the arm "
            f"({1.0 / (2.0 * np.pi * np.sqrt(per_stiffness)):.3g} Hz)"
        )
    if ratio.percent < _EXPLAINS:
        told.append(
            f"one spring explains {ratio.percent:.3g} % of the deflection: there is more to this joint"
        )
    least = 1e-6 * damping + 1e-9 * inertia
    values = {
        "stiffness": stiffness,
        "motor_inertia": inertia,
        "motor_damping": max(damping, least),
        "arm_inertia": arm_inertia,
        "arm_damping": max(stiffness * rub, least),
    }
    std = {
        "stiffness": errors[2],
        "motor_inertia": errors[0],
        "motor_damping": errors[1],
        "arm_inertia": arm_error,
        "arm_damping": stiffness * float(ratio.errors[1]),
    }
    return fits[0], chosen, values, std


def _fitted(columns: FloatArray, target: FloatArray, bounded: int, beside: tuple[str, ...]) -> _Fit:
    """Least squares whose first ``bounded`` values stay above zero; errors as of correlated residuals."""
    size = float(np.linalg.norm(target)) / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    low = np.full(columns.shape[1], -np.inf)
    low[:bounded] = 1e-6 * size[:bounded]
    values = solved(columns.T @ columns, columns.T @ target, low, np.full(columns.shape[1], np.inf))
    left = target - columns @ values
    spread = max(float(np.linalg.norm(target - target.mean())), 1e-300)
    lags = max(1, round(len(left) / max(independent(left), 1.0)))
    errors = standard_errors(columns, left, lags)
    return _Fit(values, errors, 100.0 * (1.0 - float(np.linalg.norm(left)) / spread), beside)


def _refuse_unseen(fit: _Fit, joint: str, recording: str) -> None:
    if not fit.seen(1):
        raise RecordingError(
            f"{recording}: the inertia of {joint} does not show in this motion (it explains "
            f"{fit.percent:.3g} % of the input): check sign and unit of the input, or record faster motion."
        )
