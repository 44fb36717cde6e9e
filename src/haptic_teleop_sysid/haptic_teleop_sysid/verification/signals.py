"""A scenario's recording as arrays: command, motion, torques and current of each stage on one time base."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import MismatchError
from haptic_teleop_control.robots import PAIRS, SFJ_STAGES
from haptic_teleop_sysid.recordings.recorded_parameters import recorded_text
from haptic_teleop_sysid.verification.settings import CONTROLLER, StageSettings, stage_settings

if TYPE_CHECKING:
    from haptic_teleop_control.recording import JointStateSeries, Recording

Array = NDArray[np.float64]
STATE_TOPIC, COMMAND_TOPIC = "/sfj/joint_states", "/sfj/effort_command"
MASTER_TOPIC, REFERENCE_TOPIC = "/omni/joint_states", "/reference"


@dataclass(frozen=True)
class StageRun:
    """One stage over a run, all arrays (n,) on the slave's sampling times.

    time s since the first sample; desired_torque N·m (what the master asks for); motor_position,
    arm_position rad; motor_velocity, arm_velocity rad/s; environment_torque N·m (of the robot on its
    environment); current A, measured; commanded_current A or None.
    """

    stage: str
    settings: StageSettings
    time: Array
    desired_torque: Array
    motor_position: Array
    arm_position: Array
    motor_velocity: Array
    arm_velocity: Array
    environment_torque: Array
    current: Array
    commanded_current: Array | None
    desired_from: str


def held(series: JointStateSeries, values: Array, at: NDArray[np.int64]) -> Array:
    """Return the newest of `values` (m,) whose stamp is not after each of `at` (n,) ns; zero before the
    first.
    """
    finite = np.isfinite(values)
    # A publisher that leaves its stamps empty can only be placed by the time of its arrival.
    stamps = (series.stamp if np.any(series.stamp > 0) else series.received)[finite]
    order = np.argsort(stamps, kind="stable")
    index = np.searchsorted(stamps[order], at, side="right") - 1
    known = values[finite][order]
    return np.where(index >= 0, known[np.maximum(index, 0)], 0.0) if len(known) else np.zeros(len(at))


def read_stages(
    recording: Recording, name: str, overrides: Mapping[str, Mapping[str, float]] | None = None
) -> dict[str, StageRun]:
    """Return stage -> StageRun for every stage of the 2DSFJ in the recording; `name` is what messages call
    it.

    Raises MismatchError when the 2DSFJ's states are absent, or nothing says what torque the master asked for.
    """
    states = recording.topics.get(STATE_TOPIC)
    if states is None or len(states) < 2:
        present = ", ".join(recording.topics) or "no topic"
        raise MismatchError(
            f"{name} holds {present} but no states on {STATE_TOPIC}: give a recording of scenario 1."
        )
    runs = {}
    for stage in SFJ_STAGES:
        if f"{stage}_motor" in states.names and f"{stage}_arm" in states.names:
            settings = stage_settings(recording.parameters, stage, (overrides or {}).get(stage))
            runs[stage] = _stage_run(recording, states, stage, settings, name)
    if not runs:
        raise MismatchError(
            f"{name} has {', '.join(states.names)} on {STATE_TOPIC} and no stage of the 2DSFJ: give a "
            f"recording of scenario 1."
        )
    return runs


def _stage_run(
    recording: Recording, states: JointStateSeries, stage: str, settings: StageSettings, name: str
) -> StageRun:
    motor, arm = f"{stage}_motor", f"{stage}_arm"
    motor_position, arm_position = states.signal(motor, "position"), states.signal(arm, "position")
    torque = (
        states.signal(arm, "effort")
        if states.effort is not None
        else settings.stiffness * (motor_position - arm_position)
    )
    time = states.time()
    desired, desired_from = _desired_torque(recording, states.stamp, stage, settings, name)
    command = recording.topics.get(COMMAND_TOPIC)
    commanded = None
    if command is not None and motor in command.names and command.effort is not None:
        commanded = held(command, command.signal(motor, "effort"), states.stamp) / settings.torque_constant
    measured = (
        states.signal(motor, "effort") / settings.torque_constant if states.effort is not None else commanded
    )
    return StageRun(
        stage=stage,
        settings=settings,
        time=time,
        desired_torque=desired,
        motor_position=motor_position,
        arm_position=arm_position,
        motor_velocity=_velocity(states, motor, motor_position, time),
        arm_velocity=_velocity(states, arm, arm_position, time),
        environment_torque=torque,
        current=measured if measured is not None else np.zeros(len(time)),
        commanded_current=commanded,
        desired_from=desired_from,
    )


def _velocity(states: JointStateSeries, joint: str, position: Array, time: Array) -> Array:
    if states.velocity is not None:
        return states.signal(joint, "velocity")
    return np.gradient(position, np.maximum.accumulate(time + 1e-12 * np.arange(len(time))))


def _desired_torque(
    recording: Recording, at: NDArray[np.int64], stage: str, settings: StageSettings, name: str
) -> tuple[Array, str]:
    """Desired torque, N·m, and where it is from: the master's position times the torque gain; an effort on
    /reference is the desired torque itself."""
    axis = PAIRS[stage]
    joints = (axis, f"{stage}_motor", stage)
    reference = recording.topics.get(REFERENCE_TOPIC)
    if reference is not None and reference.effort is not None:
        for joint in joints:
            if joint in reference.names:
                torque = held(reference, reference.signal(joint, "effort"), at)
                return torque, f"{REFERENCE_TOPIC}, effort of {joint}"
    # What the controller listened to; where nothing says, the artificial command if there was one.
    source = recorded_text(recording.parameters, "command_source", CONTROLLER)
    topics = [MASTER_TOPIC, REFERENCE_TOPIC] if source == "device" else [REFERENCE_TOPIC, MASTER_TOPIC]
    for topic in topics:
        series = recording.topics.get(topic)
        if series is None or series.position is None:
            continue
        for joint in joints:
            if joint in series.names:
                if settings.torque_gain is None:
                    raise MismatchError(
                        f"{name} does not say the torque gain of {stage} (haptic_teleop.parameters): give "
                        f"--torque-gain."
                    )
                position = held(series, series.signal(joint, "position"), at)
                desired = settings.torque_gain * (position - settings.neutral)
                limit = settings.desired_torque_limit
                desired = np.clip(desired, -limit, limit)
                return desired, f"{topic}, position of {joint} × {settings.torque_gain:g} N·m/rad"
    raise MismatchError(
        f"{name} holds neither {MASTER_TOPIC} nor {REFERENCE_TOPIC} with {axis}, so the desired torque of "
        f"{stage} is "
        "unknown: record one of them."
    )
