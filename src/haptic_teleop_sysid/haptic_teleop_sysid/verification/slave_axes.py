"""Scenario 2's recording as arrays: the axes of the Omni as slave, in the form that the stages of scenario 1
have.

The Omni has no force sensor, so the torque on the environment is the controller's own estimate: its observer
is run over the recording once more, with the settings that the recording names. What it cannot see, the
figures cannot either (docs/contact.md, the Omni as slave).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from haptic_teleop_control.errors import MismatchError
from haptic_teleop_control.laws.omni_slave import OmniSlaveLaw
from haptic_teleop_control.laws.sfj_master import SfjMasterSide
from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.teleoperation.sides import AXES, REFERENCES
from haptic_teleop_sysid.recordings.recorded_parameters import flattened, recorded_text, recorded_value
from haptic_teleop_sysid.verification.settings import CONTROLLER, StageSettings
from haptic_teleop_sysid.verification.signals import REFERENCE_TOPIC, Array, StageRun, held

STATE_TOPIC, COMMAND_TOPIC, MASTER_TOPIC = "/omni/joint_states", "/omni/effort_command", "/sfj/joint_states"
PLANT = ("omni_sim",)
SETTINGS = ("lambda", "torque_gain", "wall")
"""What the command line can say of an axis, by its stage."""


def read_axes(
    recording: Recording, name: str, overrides: Mapping[str, Mapping[str, float]] | None = None
) -> dict[str, StageRun]:
    """Return axis -> StageRun, motor and arm being the axis itself and its currents torques of the motor,
    N·m; `name` is what messages call the recording. overrides: as for the stages, by stage.

    Empty where the recording lacks the Omni's states or what says which torque was asked for.
    Raises MismatchError where they are there without a field that is needed.
    """
    states = recording.topics.get(STATE_TOPIC)
    if states is None or len(states) < 2 or not set(AXES) <= set(states.names):
        return {}
    if states.position is None or states.velocity is None or states.effort is None:
        raise MismatchError(
            f"{name}: {STATE_TOPIC} lacks positions, velocities or efforts: record whole states."
        )
    values = _stated(recording.parameters)
    period = float(np.median(np.diff(states.time())))
    law = OmniSlaveLaw.from_parameters(values, AXES, period)
    side = SfjMasterSide.from_parameters(values, STAGES, period)
    desired, origin = _desired(recording, states, side)
    if desired is None:
        return {}
    torque = _estimate(law, *(_columns(states, field) for field in ("position", "velocity", "effort")))
    command = recording.topics.get(COMMAND_TOPIC)
    runs = {}
    for number, (axis, stage) in enumerate(zip(AXES, STAGES, strict=True)):
        position, velocity = states.signal(axis, "position"), states.signal(axis, "velocity")
        commanded = None
        if command is not None and command.effort is not None and axis in command.names:
            commanded = held(command, command.signal(axis, "effort"), states.stamp)
        given = (overrides or {}).get(stage, {})
        runs[axis] = StageRun(
            stage=axis,
            settings=_settings(recording.parameters, axis, law, side, number, given),
            time=states.time(),
            desired_torque=desired[:, number],
            motor_position=position,
            arm_position=position,
            motor_velocity=velocity,
            arm_velocity=velocity,
            environment_torque=torque[:, number],
            current=states.signal(axis, "effort"),
            commanded_current=commanded,
            desired_from=origin,
        )
    return runs


def _stated(parameters: Mapping[str, Any]) -> dict[str, Any]:
    for node, content in parameters.items():
        if str(node).rstrip("/").rsplit("/", 1)[-1] in CONTROLLER and isinstance(content, Mapping):
            return dict(flattened(content))
    return {}


def _columns(series: JointStateSeries, field: str) -> Array:
    return np.column_stack([series.signal(axis, field) for axis in AXES])


def _estimate(law: OmniSlaveLaw, position: Array, velocity: Array, effort: Array) -> Array:
    found = np.zeros(position.shape)
    law.enabled[:] = False
    nothing = np.zeros(len(AXES))
    for k in range(len(position)):
        law.step(nothing, position[k], velocity[k], effort[k])
        found[k] = law.environment_torque
    return found


def _desired(recording: Recording, states: JointStateSeries, side: SfjMasterSide) -> tuple[Array | None, str]:
    """Td of both axes on the Omni's stamps, from what the controller listened to."""
    joints, field = REFERENCES["sfj"]
    device = recorded_text(recording.parameters, "command_source", CONTROLLER) == "device"
    topic, sign = (MASTER_TOPIC, 1.0) if device else (REFERENCE_TOPIC, -1.0)
    series = recording.topics.get(topic)
    if series is None or getattr(series, field) is None or not set(joints) <= set(series.names):
        return None, ""
    torques = [held(series, sign * series.signal(joint, field), states.stamp) for joint in joints]
    return side.desired(np.column_stack(torques)), f"{topic}, {field} of {' and '.join(joints)}"


def _settings(
    parameters: Mapping[str, Any],
    axis: str,
    law: OmniSlaveLaw,
    side: SfjMasterSide,
    number: int,
    overrides: Mapping[str, float],
) -> StageSettings:
    wall = recorded_value(parameters, (f"{axis}.wall.angle",), PLANT)
    known = {
        "lambda": (law.settings[number].lambda_, "recording, force_controller"),
        "torque_gain": (side.settings[number].torque_gain, "recording, force_controller"),
        "wall": (None, "unknown") if wall is None else (wall[0], f"recording, {wall[1]}"),
    }
    known |= {key: (overrides[key], "command line") for key in SETTINGS if key in overrides}
    return StageSettings(
        lambda_=known["lambda"][0],
        torque_gain=known["torque_gain"][0],
        neutral=0.0,
        wall_angle=known["wall"][0],
        stiffness=float("nan"),
        torque_constant=1.0,
        current_limit=law.settings[number].torque_limit,
        source={key: source for key, (_, source) in known.items()},
    )
