"""A recording as a data set for one model: input and response of one joint on one uniform time grid."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import MismatchError, RecordingError
from haptic_teleop_control.recording import Recording, bag_problems
from haptic_teleop_control.robots import SFJ_STAGES, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING
from haptic_teleop_sim.model import Model, other_signals
from haptic_teleop_sysid.recordings.banded_derivative import banded_derivative, to_the_next
from haptic_teleop_sysid.recordings.channels import Channels, channels_for
from haptic_teleop_sysid.recordings.damage import encoder_step, refuse_holes
from haptic_teleop_sysid.recordings.encoder_zeros import arm_zero, told
from haptic_teleop_sysid.recordings.motion import (
    Damage,
    finite,
    leave_out_stills,
    motion,
    without_wrong_readings,
)
from haptic_teleop_sysid.recordings.recorded_parameters import first_stated, recorded_units
from haptic_teleop_sysid.recordings.slips import Slip
from haptic_teleop_sysid.recordings.time_grid import GAP_PERIODS, NS, TimeGrid

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DataSet:
    """One joint's experiment. All arrays (n,) float64 on `time`, s since the recording's first sample.

    input            what acts from a sample to the next, in `input_unit`: A (sfj), otherwise the recorded
    effort (N·m, or what an imported log had: N, A, V, pu)
    input_source     which recorded field the input is
    input_read       whether the input was read at the samples and is smooth between them, so that this is its
                     mean from each to the next (`diagnosis.inputs.between_samples`)
    commanded_input  the command that answered each sample, same unit; None when not recorded
    motor_position, motor_velocity, arm_position, arm_velocity
                     rad, rad/s (m, m/s for a linear axis: `position_unit`); arm None when the model has none
    exogenous        acceleration of the robot's other arm, rad/s², for inertial coupling (its angle or
                     velocity for a map that follows it), the mean from a sample to the next; None without it
    valid            False inside holes longer than GAP_PERIODS periods and where nothing usable was read
    velocity_filter  (cut-off in Hz, damping) of the filter that made the velocities; None: taken as true
    problems         sentences about the recording, empty when all is well
    slips            where an encoder slipped or lost counts; positions and velocities are put back
    """

    name: str
    robot: str
    joint: str
    dt: float
    input: Array
    input_unit: str
    input_source: str
    motor_position: Array
    motor_velocity: Array
    arm_position: Array | None = None
    arm_velocity: Array | None = None
    commanded_input: Array | None = None
    exogenous: Array | None = None
    valid: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    velocity_filter: tuple[float, float] | None = None
    start: float = 0.0
    resampled: bool = False
    problems: tuple[str, ...] = ()
    slips: tuple[Slip, ...] = ()
    experiment: dict[str, Any] = field(default_factory=dict)
    position_unit: str = "rad"
    input_read: bool = False

    def __len__(self) -> int:
        return len(self.input)

    @property
    def time(self) -> Array:
        """Sampling times (n,), s, since the recording's first sample."""
        return self.start + self.dt * np.arange(len(self.input), dtype=np.float64)

    def signals(self) -> dict[str, Array]:
        """Measured outputs by name: `<joint>_motor.position`, `<joint>_motor.velocity`, and `_arm` where
        there is one.
        """
        found = {
            f"{self.joint}_motor.position": self.motor_position,
            f"{self.joint}_motor.velocity": self.motor_velocity,
        }
        if self.arm_position is not None and self.arm_velocity is not None:
            found |= {
                f"{self.joint}_arm.position": self.arm_position,
                f"{self.joint}_arm.velocity": self.arm_velocity,
            }
        return found

    def units(self) -> dict[str, str]:
        """Unit of each name in `signals`."""
        unit = self.position_unit
        return {name: unit if name.endswith("position") else f"{unit}/s" for name in self.signals()}

    def between(self, start: float, end: float) -> DataSet:
        """Return the part from `start` to `end`, s of `time`. RecordingError when it holds fewer than ten
        samples.
        """
        if not -np.inf < start < end < np.inf:
            raise RecordingError(
                f"{self.name}: from {start:g} to {end:g} s is no stretch of time: give --range START END, "
                "the lower first."
            )
        first = max(0, int(np.ceil((start - self.start) / self.dt - 1e-6)))
        stop = min(len(self), int(np.floor((end - self.start) / self.dt + 1e-6)) + 1)
        if stop - first < 10:
            last = float(self.time[-1])
            raise RecordingError(
                f"{self.name} covers {self.start:g} to {last:.3f} s and has no ten samples from {start:g} "
                f"to {end:g} s: "
                "give another --range."
            )
        parts = {
            name: value[first:stop] for name, value in self.__dict__.items() if isinstance(value, np.ndarray)
        }
        return DataSet(**{**self.__dict__, **parts, "start": float(self.time[first])})


def load_dataset(recording: Recording, model: Model, name: str = "", allow_gaps: bool = False) -> DataSet:
    """Return what `recording` says about the model's joint; `name` is what messages and results call the
    recording.

    The measured effort is the input where it was recorded (its newest value acted until it was measured, so
    it is taken one sample early), the commanded effort otherwise. Stamps that repeat or run backward are
    dropped; others are moved to a uniform grid only where they are off it by more than IRREGULAR of a period.

    Readings that no joint can have made (`damage.py`) count as not taken; an arm's encoder that counts from
    another zero than the motor's is put to the motor's (`encoder_zeros.py`).

    Raises MismatchError when the recording does not hold what the model describes, RecordingError when it has
    fewer than ten samples, no movement recorded, or holes longer than GAP_PERIODS periods (nothing sent, no
    number, a sensor that stood still, a clock that was set back) and `allow_gaps` is false.
    """
    name = name or str(recording.path)
    channels = channels_for(model, recording, name)
    grid = TimeGrid.of(channels.states, name)
    quality = bag_problems(channels.states, channels.topic, GAP_PERIODS)
    if quality.gaps and not allow_gaps:
        start, length = max(quality.gaps, key=lambda gap: gap[1])
        raise RecordingError(
            f"{name}: {channels.topic} has {counted(len(quality.gaps), 'hole')} longer than "
            f"{GAP_PERIODS:g} periods, "
            "the longest of "
            f"{length:.3f} s at {start:.3f} s: record again, or say --allow-gaps to leave them out."
        )
    if grid.set_back and not allow_gaps:
        start, count = grid.set_back[0]
        raise RecordingError(
            f"{name}: the clock of {channels.topic} was set back or stood still before {start:.3f} s: "
            f"{count} samples cannot be placed in time. Record again, or say --allow-gaps to leave them out."
        )
    scale = 1.0 / _torque_constant(recording, model) if model.robot == "sfj" else 1.0
    measured, commanded = _inputs(channels, grid, scale)
    valid = grid.valid.copy()
    damage = Damage()
    motor, motor_rate = motion(channels.motor, grid, model.robot, valid, damage)
    if not np.any(np.isfinite(motor)):
        raise RecordingError(
            f"{name}: no position of {channels.motor.joint} is a finite number: record it again."
        )
    arm, arm_rate = (
        (None, None) if channels.arm is None else motion(channels.arm, grid, model.robot, valid, damage)
    )
    if arm is not None and not np.any(np.isfinite(arm)):
        arm = arm_rate = None  # as if nobody had recorded it; the stream's problems tell
    input_, source = (
        (measured, "measured effort") if measured is not None else (commanded, "commanded effort")
    )
    if input_ is None:
        raise MismatchError(
            f"{name} holds no effort of {channels.motor.joint}, neither measured nor commanded: record it."
        )
    input_ = finite(input_, valid)
    if channels.arm is not None and arm is not None:
        both = {channels.motor.joint: motor, channels.arm.joint: arm}
        read = [encoder_step(c.values("position")[grid.keep]) for c in (channels.motor, channels.arm)]
        leave_out_stills(both, dict(zip(both, read, strict=True)), grid.dt, valid, damage)
    if not allow_gaps:
        refuse_holes(valid, grid.dt, name, damage.told)
    units = recorded_units(recording.experiment, channels.motor.joint)
    zero = 0.0 if arm is None else arm_zero(motor, arm, input_, valid, grid.dt, model)
    zeros = (told(zero, units["position"]),) if zero else ()
    other = _of_other_arm(channels, grid, model, damage)
    encoders = {channels.motor.joint: model.location("motor_encoder")}
    if channels.arm is not None:
        encoders[channels.arm.joint] = model.location("arm_encoder")
    return DataSet(
        name=name,
        robot=model.robot,
        joint=model.joint,
        dt=grid.dt,
        input=input_,
        input_unit="A" if model.robot == "sfj" else units["input"],
        input_source=source,
        motor_position=motor,
        motor_velocity=motor_rate,
        arm_position=None if arm is None else arm - zero,
        arm_velocity=arm_rate,
        commanded_input=None if commanded is None else finite(commanded, None),
        exogenous=other,
        valid=valid,
        velocity_filter=None
        if model.robot == "generic"
        else (VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING),
        resampled=grid.resampled,
        problems=(*quality.problems, *damage.told, *zeros),
        slips=tuple(replace(s, encoder=encoders[s.encoder]) for s in damage.slips),
        experiment=dict(recording.experiment),
        position_unit=units["position"],
    )


def _inputs(channels: Channels, grid: TimeGrid, scale: float) -> tuple[Array | None, Array | None]:
    commanded = None
    if channels.command is not None:
        series, values = channels.command.series, channels.command.values("effort")
        stamps = grid.stamps[0] + np.rint(grid.at / NS).astype(np.int64)
        order = np.argsort(series.stamp, kind="stable")
        # Half a period of grace: a stamp that was rounded elsewhere still answers its state.
        index = np.searchsorted(series.stamp[order], stamps + int(0.5 * grid.dt / NS), side="right") - 1
        known = values[order]
        if np.any(np.isfinite(known)):  # otherwise as if nobody had recorded it; the stream's problems tell
            commanded = scale * np.where(index >= 0, known[np.maximum(index, 0)], 0.0)
    values = channels.input.values_or_none("effort" if channels.input_field is None else channels.input_field)
    if values is None or not np.any(np.isfinite(values)):
        return None, commanded
    measured = scale * grid.sampled(values)
    if channels.measured_late:
        measured = np.concatenate([measured[1:], measured[-1:]])
    return measured, commanded


def _of_other_arm(channels: Channels, grid: TimeGrid, model: Model, damage: Damage) -> Array | None:
    """What the model's effects follow of the robot's other arm: its acceleration, unless a map says other;
    None where nothing of it was read. What is wrong with its readings is told with the `damage`."""
    other = channels.other_arm
    if other is None:
        return None
    own = Damage()
    read = without_wrong_readings(other.values("position"), other.joint, grid, own)
    damage.told += own.told
    position = finite(grid.sampled(read), None)
    if not np.any(np.isfinite(position)):
        return None
    order = {"other_angle": 0, "other_velocity": 1}.get(next(iter(other_signals(model)), ""), 2)
    return to_the_next(banded_derivative(position, order, grid.dt))


def _torque_constant(recording: Recording, model: Model) -> float:
    """Nominal N·m/A of the recorded effort: what the recording says, else the nominal number of the stage.

    Raises RecordingError for one that cannot be."""
    keys, nominal = (f"{model.joint}.torque_constant",), SFJ_STAGES[model.joint].torque_constant
    stated = first_stated(recording.parameters, keys, ("sfj_driver", "sfj_sim", "force_controller"))
    if stated is None:
        return nominal
    value, where = stated
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < math.inf:
        raise RecordingError(
            f"{recording.path}: {where} is {value!r}: correct it in haptic_teleop.parameters of its "
            f"metadata.yaml, or leave it out everywhere for {nominal:g} N·m/A."
        )
    return float(value)
