"""Which recorded signals a model speaks of, and a clear refusal when the recording does not hold them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import MismatchError
from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_control.robots import STAGES
from haptic_teleop_sim.model import Model

Array = NDArray[np.float64]
STATES = {"sfj": "/sfj/joint_states", "omni": "/omni/joint_states"}
_COMMANDS = {"sfj": "/sfj/effort_command", "omni": "/omni/effort_command"}


@dataclass(frozen=True)
class Channel:
    """One joint of one topic."""

    series: JointStateSeries
    joint: str

    def values(self, field: str) -> Array:
        """Return (messages,) of `position`, `velocity` or `effort`; RecordingError when it was not
        recorded.
        """
        return self.series.signal(self.joint, field)

    def values_or_none(self, field: str) -> Array | None:
        """Return the same, or None when the field was not recorded."""
        return None if getattr(self.series, field) is None else self.values(field)


@dataclass(frozen=True)
class Channels:
    """Everything a data set is made of. `states` (on `topic`) gives the time base.

    `measured_late`: the measured effort of a sample is what acted before it, as this project's drivers
    report it.
    """

    topic: str
    states: JointStateSeries
    motor: Channel
    arm: Channel | None
    input: Channel
    input_field: str | None
    command: Channel | None
    other_arm: Channel | None
    measured_late: bool


def channels_for(model: Model, recording: Recording, name: str) -> Channels:
    """Return the channels of the model's joint.

    Raises MismatchError, naming both files and what the recording has, when they do not belong together.
    """
    return _generic(model, recording, name) if model.robot == "generic" else _robot(model, recording, name)


def _robot(model: Model, recording: Recording, name: str) -> Channels:
    topic = STATES[model.robot]
    states = _topic(model, recording, name, topic)
    if model.robot == "sfj":
        motor_joint, arm_joint = f"{model.joint}_motor", f"{model.joint}_arm"
    else:
        motor_joint, arm_joint = model.joint, None
    motor = _channel(model, name, topic, states, motor_joint)
    arm = None
    if arm_joint is not None and model.structure == "flexible_joint":
        arm = _channel(model, name, topic, states, arm_joint)
    command_series = recording.topics.get(_COMMANDS[model.robot])
    command = None
    if (
        command_series is not None
        and motor_joint in command_series.names
        and command_series.effort is not None
    ):
        command = Channel(command_series, motor_joint)
    other = [f"{stage}_arm" for stage in STAGES if stage != model.joint and f"{stage}_arm" in states.names]
    other_arm = (
        Channel(states, other[0]) if model.robot == "sfj" and other and states.position is not None else None
    )
    if motor.values_or_none("position") is None:
        raise _mismatch(model, name, f"carries no positions on {topic}", "record them")
    return Channels(topic, states, motor, arm, motor, None, command, other_arm, measured_late=True)


_IO_KEYS, _ENTRY_KEYS = ("input", "motor", "arm"), ("topic", "joint", "field")


def _generic(model: Model, recording: Recording, name: str) -> Channels:
    io = model.io
    if not io:
        raise _mismatch(
            model,
            name,
            f"holds {_present(recording)}",
            "say in the model file's io section which topics to use",
        )
    for key in io:
        if key not in _IO_KEYS:
            raise _mismatch(model, name, f"has no use for io.{key}", f"give io {', '.join(_IO_KEYS)} alone")
    input_topic, input_joint, field = _entry(model, name, io, "input")
    motor_topic, motor_joint, _ = _entry(model, name, io, "motor")
    states = _topic(model, recording, name, motor_topic)
    motor = _channel(model, name, motor_topic, states, motor_joint)
    if motor.values_or_none("position") is None:
        raise _mismatch(
            model, name, f"carries no positions on {motor_topic}", "correct io.motor or record them"
        )
    arm = None
    if io.get("arm") is not None and model.structure == "flexible_joint":
        arm_topic, arm_joint, _ = _entry(model, name, io, "arm")
        if arm_topic != motor_topic:
            raise _mismatch(
                model, name, f"has the arm on {arm_topic}", f"give motor and arm on one topic ({motor_topic})"
            )
        arm = _channel(model, name, arm_topic, states, arm_joint)
    field = field or "effort"
    source = _channel(model, name, input_topic, _topic(model, recording, name, input_topic), input_joint)
    if source.values_or_none(field) is None:
        raise _mismatch(
            model, name, f"carries no {field} of {input_joint} on {input_topic}", "correct io.input.field"
        )
    if input_topic == motor_topic:
        return Channels(motor_topic, states, motor, arm, source, field, None, None, measured_late=False)
    if field != "effort":
        # Whatever field carries the input, what follows reads it as an effort.
        one = source.series
        renamed = JointStateSeries(one.stamp, one.received, one.names, effort=getattr(one, field))
        source = Channel(renamed, input_joint)
    empty = Channel(JointStateSeries(states.stamp, states.received, states.names), motor_joint)
    return Channels(motor_topic, states, motor, arm, empty, None, source, None, measured_late=False)


def _entry(model: Model, name: str, io: Mapping[str, Any], key: str) -> tuple[str, str, str | None]:
    entry = io.get(key)
    if not isinstance(entry, Mapping) or "topic" not in entry or "joint" not in entry:
        raise _mismatch(
            model, name, f"cannot be read without io.{key}", f"give io.{key} as {{topic: ..., joint: ...}}"
        )
    for unknown in entry:
        if unknown not in _ENTRY_KEYS:
            raise _mismatch(
                model, name, f"has no use for io.{key}.{unknown}", f"give {', '.join(_ENTRY_KEYS)} alone"
            )
    field = entry.get("field")
    if field is not None and field not in ("position", "velocity", "effort"):
        raise _mismatch(
            model, name, f"has no field {field!r}", f"give io.{key}.field as position, velocity or effort"
        )
    return str(entry["topic"]), str(entry["joint"]), None if field is None else str(field)


def _topic(model: Model, recording: Recording, name: str, topic: str) -> JointStateSeries:
    series = recording.topics.get(topic)
    if series is None or not len(series):
        remedy = (
            "correct the io section"
            if model.robot == "generic"
            else "give a recording of that robot, or another model"
        )
        raise _mismatch(model, name, f"has no {topic}; it holds {_present(recording)}", remedy)
    return series


def _channel(model: Model, name: str, topic: str, series: JointStateSeries, joint: str) -> Channel:
    if joint not in series.names:
        remedy = (
            "correct the io section" if model.robot == "generic" else "choose a model of one of those joints"
        )
        raise _mismatch(
            model, name, f"has no joint {joint} on {topic}; it has {', '.join(series.names)}", remedy
        )
    return Channel(series, joint)


def _present(recording: Recording) -> str:
    return (
        ", ".join(f"{topic} ({', '.join(series.names)})" for topic, series in recording.topics.items())
        or "no topic"
    )


def _mismatch(model: Model, name: str, what: str, remedy: str) -> MismatchError:
    return MismatchError(
        f"{model.source} describes {model.joint} of {model.robot}, but {name} {what}: {remedy}."
    )
