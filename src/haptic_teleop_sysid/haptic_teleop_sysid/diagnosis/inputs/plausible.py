"""Recordings that cannot be what they are taken for: another unit, or another structure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import MismatchError, RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_control.robots import SFJ_STAGES
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record, with_trusted_input
from haptic_teleop_sysid.recordings.channels import channels_for
from haptic_teleop_sysid.recordings.dataset import DataSet

#: No joint of these robots turns so far, rad.
_FURTHEST = 2.0 * np.pi
#: Steps of the arm's encoder by which an arm that moves with its motor may differ from it.
_GIVES = 10.0
#: Factor between measured and commanded effort beyond which one of them has another unit.
_ANOTHER_UNIT = 20.0
#: Shares of the most driven and the most moved recording below which a joint is held, not driven.
_HARDLY_DRIVEN, _HARDLY_MOVES = 0.05, 0.01
#: Standard deviation of an input, relative to its rms, below which it is one value; share of the top speed
#: from which the motor moves; and mean sign of its velocity from which that is one way.
_HARDLY_VARIES, _SLOW, _ONE_WAY = 0.005, 0.05, 0.9
#: Factor over the scatter of its readings from which a joint moves.
_SCATTER = 1.5
#: Share of an angle that rounding may change it by.
_ROUNDING = 1e-12
#: Share of the input that its angle or velocity explains, from which it is no force; and the same from which
#: nothing of an inertia shows, if it is so in all recordings that are fitted: a velocity that comes of
#: rounded angles explains 0.9995 of one that it is. At most 0.983 on 70 recordings of real joints and 0.995
#: on 200 of the benchmark.
_ALL_OF_IT, _NEARLY_ALL_OF_IT = 0.9999, 0.999
#: Samples of one recording that are sought in another, how often, and different angles in them from which the
#: joint moves: readings at rest are alike in any two recordings.
_PROBE, _PROBES, _MOVES = 200, 20, 20
#: Share of a recording's travel that the stretch around them must have: two simulations with one seed are
#: alike as long as they rest.
_TRAVELS = 0.02
#: Change of their slope, as a share of their travel, below which angles are a straight line.
_STRAIGHT = 1e-6


def refuse_implausible(model: Model, recording: Recording, dataset: DataSet) -> None:
    """Raise RecordingError for positions that cannot be radians, MismatchError for a rigid body whose arm is
    seen to give."""
    position = dataset.motor_position
    travel = float(np.nanmax(position) - np.nanmin(position))
    if model.robot in ("sfj", "omni") and travel > _FURTHEST:
        raise RecordingError(
            f"{dataset.name}: {dataset.joint} turns by {travel:.3g} rad, further than it can: record "
            "positions in rad, not in degrees."
        )
    if model.robot != "sfj" or not model.rigid:
        return
    states, names = (
        channels_for(model, recording, dataset.name).states,
        (f"{model.joint}_motor", f"{model.joint}_arm"),
    )
    if names[1] not in states.names:
        return
    motor, arm = (states.signal(name, "position") for name in names)
    gives = float(np.nanmax(np.abs(motor - arm)))
    if gives > _GIVES * SFJ_STAGES[model.joint].joint_resolution:
        raise MismatchError(
            f"{model.source} describes a rigid body, but in {dataset.name} {names[1]} moves by up to "
            f"{gives:.3g} rad against its motor: give a model of structure flexible_joint."
        )


def refuse_idle(datasets: Sequence[DataSet]) -> None:
    """Raise RecordingError for a recording in which the joint hardly is driven and moves beside others (one
    in which it is not driven at all is told by itself).

    Its controller then holds it while another joint is driven, and rounded readings agree with any model."""
    drives = [float(np.nanstd(d.input)) for d in datasets]
    travels = [float(np.nanstd(d.motor_position)) for d in datasets]
    for dataset, drive, travel in zip(datasets, drives, travels, strict=True):
        if 0.0 < drive < _HARDLY_DRIVEN * max(drives) and travel < _HARDLY_MOVES * max(travels):
            raise RecordingError(
                f"{dataset.name}: beside another recording {dataset.joint} is driven by "
                f"{100 * drive / max(drives):.2g} % and moves by {100 * travel / max(travels):.2g} %: "
                "that says nothing of it. Record while this joint is driven, or leave the recording out."
            )


def refuse_constant_input(datasets: Sequence[DataSet]) -> None:
    """Raise RecordingError where one value drives the joint one way in all these recordings, as long as it
    moves: damping then takes up any other torque."""
    moving = [_while_moving(with_trusted_input(d, commanded=True)) for d in datasets]
    every, speed = (np.concatenate(columns) for columns in zip(*moving, strict=True))
    size = float(np.sqrt(np.mean(every**2))) if len(every) else 0.0
    one_way = len(speed) > 0 and abs(float(np.mean(np.sign(speed)))) > _ONE_WAY
    if one_way and float(np.std(every)) < _HARDLY_VARIES * size:
        unit = datasets[0].input_unit
        raise RecordingError(
            f"{', '.join(d.name for d in datasets)}: the input hardly varies ({every.min():.4g} to "
            f"{every.max():.4g} {unit}), so that nothing tells friction or a load from damping: record with "
            "an input that changes, or several steps of different sizes."
        )


def _while_moving(data: DataSet) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Input and velocity, (n,) each, of the samples at which the motor moves."""
    speed = data.motor_velocity
    moves = np.abs(speed) > _SLOW * float(np.nanmax(np.abs(speed), initial=0.0))
    moves &= np.isfinite(data.input)
    return data.input[moves], speed[moves]


def refuse_copies(datasets: Sequence[DataSet]) -> None:
    """Raise RecordingError for two recordings of which one holds a stretch of the other's readings: a model
    is proved on what it was not fitted to, and no two recordings of a machine are alike in every encoder
    step."""
    for i, one in enumerate(datasets):
        for other in datasets[:i]:
            if _begin_alike(one, other) or _shared(one, other):
                raise RecordingError(
                    f"{one.name} holds the readings of {other.name} once more: learn from, judge by and show "
                    "with different recordings."
                )


def _begin_alike(one: DataSet, other: DataSet) -> bool:
    n = min(len(one), len(other))
    return all(
        np.array_equal(getattr(one, name)[:n], getattr(other, name)[:n], equal_nan=True)
        for name in ("motor_position", "input")
    )


def _shared(one: DataSet, other: DataSet) -> bool:
    """Whether a stretch of the shorter one, with motion in it, stands somewhere in the longer one."""
    short, long = sorted((one, other), key=len)
    angles = np.ascontiguousarray(long.motor_position)
    whole, size = angles.tobytes(), angles.itemsize
    least = _TRAVELS * float(np.nanmax(short.motor_position) - np.nanmin(short.motor_position))
    for start in np.linspace(0, len(short) - _PROBE, _PROBES).astype(int).tolist():
        angle = np.ascontiguousarray(short.motor_position[start : start + _PROBE])
        if start < 0 or not _tells(angle):
            continue
        at = whole.find(angle.tobytes())
        while at >= 0:
            if at % size == 0 and _alike_around(short, long, start, at // size) > least:
                return True
            at = whole.find(angle.tobytes(), at + 1)
    return False


def _alike_around(short: DataSet, long: DataSet, start: int, first: int) -> float:
    """Travel of the longest stretch around the `_PROBE` samples from ``start`` of the one and ``first`` of
    the other in which both have the same angles and inputs; 0 where they differ within these samples."""
    before, after = min(start, first), min(len(short) - start, len(long) - first)
    here, there = slice(start - before, start + after), slice(first - before, first + after)
    angle = short.motor_position[here]
    alike = (angle == long.motor_position[there]) & (short.input[here] == long.input[there])
    other = np.flatnonzero(~alike)
    begin = int(np.max(other[other < before], initial=-1)) + 1
    end = int(np.min(other[other >= before], initial=len(alike)))
    return float(np.ptp(angle[begin:end])) if end - before >= _PROBE else 0.0


def _tells(angle: NDArray[np.float64]) -> bool:
    """Whether angles are a recording's own: they change, and not at one speed, as those of a log do that has
    the speed alone, in steps."""
    bent = float(np.max(np.abs(np.diff(angle, 2)))) > _STRAIGHT * float(np.ptp(angle))
    return bent and len(np.unique(angle)) >= _MOVES


def with_contradictions(dataset: DataSet) -> DataSet:
    """The data set whose problems also say that commanded and measured effort cannot have one unit, and that
    an arm's reading never changes while its motor moves."""
    arm, motor = dataset.arm_position, dataset.motor_position
    travel = float(np.nanmax(motor) - np.nanmin(motor))
    if arm is not None and travel > 0.0 and float(np.nanmax(arm) - np.nanmin(arm)) == 0.0:
        problem = (
            f"the arm's angle never changes while the motor moves by {travel:.3g} {dataset.position_unit}: "
            "its encoder is dead, or the arm is held; leave the channel out, or give a model of what moves"
        )
        dataset = replace(dataset, problems=(*dataset.problems, problem))
    if dataset.commanded_input is None or dataset.input_source != "measured effort":
        return dataset
    command, measured = (float(np.nanstd(v)) for v in (dataset.commanded_input, dataset.input))
    if min(command, measured) <= 0.0 or 1.0 / _ANOTHER_UNIT < measured / command < _ANOTHER_UNIT:
        return dataset
    problem = (
        f"the measured effort is {measured / command:.3g} times the commanded one (rms {measured:.3g} and "
        f"{command:.3g} {dataset.input_unit}): one of them may have another unit"
    )
    return replace(dataset, problems=(*dataset.problems, problem))


def refuse_motionless(pieces: Sequence[Record], joint: str) -> None:
    """Raise RecordingError where nothing drives the joint in any piece of a recording, or its motor does not
    move by more than its encoder's step, or than its readings scatter by."""
    driven = np.concatenate([piece.input for piece in pieces])
    if not float(np.nanstd(driven)) > 1e-9 * max(float(np.nanmax(np.abs(driven))), 1e-300):
        what = "input"
    else:
        read = [piece.measured[np.isfinite(piece.measured[:, 0]), 0] for piece in pieces]
        angles = [one for one in read if len(one)] or [np.zeros(4)]
        travel = max(float(np.ptp(one)) for one in angles)
        about = np.concatenate([one - np.mean(one) for one in angles])  # moved between them is not driven
        # Third differences leave of a smooth motion what its readings scatter by (variance 20 times theirs).
        scatter = float(np.std(np.concatenate([np.diff(one, 3) for one in angles]))) / np.sqrt(20.0)
        moves = travel > _ROUNDING * max(float(np.max(np.abs(one))) for one in angles)
        if moves and float(np.std(about)) > max(0.5 * pieces[0].resolution[0], _SCATTER * scatter):
            return
        what = "motor angle"
    raise RecordingError(
        f"{pieces[0].name}: the {what} of {joint} does not change, so there is nothing to diagnose: record "
        "while this joint is driven, or give the model of the one that was."
    )


def refuse_kinematic(fitted: Sequence[DataSet], others: Sequence[DataSet] = ()) -> None:
    """Raise RecordingError where the input is the motion itself (a set-point, a velocity) and no force, or
    where the joint follows its input as if it had no mass, in one recording exactly or in all that are
    ``fitted`` nearly: of its inertia then nothing shows."""
    alike = {id(d): _most_alike(d) for d in (*fitted, *others)}
    nearly = all(alike[id(d)][0] > _NEARLY_ALL_OF_IT for d in fitted)
    for dataset in (*fitted, *others):
        share, what = alike[id(dataset)]
        if share > (_NEARLY_ALL_OF_IT if nearly else _ALL_OF_IT):
            raise RecordingError(
                f"{dataset.name}: the input of {dataset.joint} is its {what} but for a factor "
                f"({100.0 * share:.4g} % of it), as if it were the motion itself, or drove a joint without "
                "mass: give the force, torque or current that drives the joint as the input, or, if it is "
                "that, record faster motions, in which its inertia shows."
            )


def _most_alike(dataset: DataSet) -> tuple[float, str]:
    """The share of an input that the angle or the velocity explains, and which of the two."""
    good = dataset.valid if len(dataset.valid) else np.ones(len(dataset), dtype=np.bool_)
    found = [(0.0, "angle")]
    for what, values in (("angle", dataset.motor_position), ("velocity", dataset.motor_velocity)):
        drive, motion = dataset.input[good], values[good]
        both = np.isfinite(drive) & np.isfinite(motion)
        if np.std(drive[both]) > 0.0 and np.std(motion[both]) > 0.0:
            found.append((float(np.corrcoef(drive[both], motion[both])[0, 1]) ** 2, what))
    return max(found)
