"""ROS bags of either generation, in MCAP or SQLite3 if of ROS 2, as columns `topic:field`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import get_types_from_msg

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_control.recording.expansion import Damaged
from haptic_teleop_sysid.logs.bag_messages import BagMessages, bag_messages
from haptic_teleop_sysid.logs.bag_types import BagTypes
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.messages import getters, joints_of, stamp_of

#: Bytes of a message from which it is a picture or a cloud and holds no signal of a joint.
LARGE = 16384
_UNITS = (
    ("wrench.force", "N"),
    ("wrench.torque", "N*m"),
    ("linear_acceleration", "m/s^2"),
    ("angular_velocity", "rad/s"),
    ("twist.angular", "rad/s"),
    ("twist.linear", "m/s"),
)
_OF_JOINTS = {"position": "rad", "velocity": "rad/s", "effort": "N*m"}


def read_bag(path: Path, topics: Sequence[str] | None = None, definitions: Sequence[Path] = ()) -> Log:
    """Return the numbers of a bag, of ``topics`` alone where given; ``definitions``: .msg files for messages
    that the bag does not define, named after their type (`package/msg/Type.msg`)."""
    extra: dict[str, Any] = {}
    for file in definitions:
        extra.update(_definition(file))
    types = BagTypes(extra)
    try:
        return _read(path, bag_messages(path, types, topics), types, topics)
    except (OSError, Damaged) as error:
        raise RecordingError(
            f"{path} is a damaged bag, or of a storage that is not known ({error}): try `ros2 bag convert`, "
            "or `rosbag reindex` for a ROS 1 bag."
        ) from error


def _definition(file: Path) -> dict[str, Any]:
    parts = file.with_suffix("").parts
    if file.suffix != ".msg" or len(parts) < 2:
        raise ConfigurationError(f"--msg {file}: give a file that is named like package/msg/Type.msg.")
    package = parts[-3] if len(parts) > 2 and parts[-2] == "msg" else parts[-2]
    try:
        return dict(get_types_from_msg(file.read_text(encoding="utf-8"), f"{package}/msg/{parts[-1]}"))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"--msg {file} cannot be read ({error}): name another file.") from error
    except Exception as error:  # the parser's own errors have no common base
        raise ConfigurationError(f"--msg {file} is no message definition ({error}): correct it.") from error


def _read(path: Path, bag: BagMessages, types: BagTypes, topics: Sequence[str] | None) -> Log:
    unknown: set[str] = set()

    def select(topic: str, kind: str) -> bool:
        if topics is not None and topic not in topics:
            return False
        if not types.known(kind):
            unknown.add(f"{topic} ({kind})")
            return False
        return True

    rows: dict[str, _Rows] = {}
    large: set[str] = set()
    for message in bag.messages(select):
        if len(message.data) > LARGE:
            large.add(message.topic)
            continue
        decoded = types.decode(message.kind, message.data, bag.ros1)
        rows.setdefault(message.topic, _Rows(message.kind)).add(decoded, message.received)
    for topic in topics or ():
        if topic not in bag.topics:
            present = ", ".join(sorted(bag.topics)) or "none"
            raise RecordingError(f"{path} has no topic {topic}: correct the mapping (it has {present}).")
    remarks = ["read as a ROS bag, with the times of the messages' headers where they have one"]
    if unknown:
        names = ", ".join(sorted(unknown))
        remarks.append(f"not defined and passed over: {names}; give the definitions with --msg FILE.msg")
    if large:
        remarks.append(f"passed over, messages of more than {LARGE} bytes: {', '.join(sorted(large))}")
    remarks += bag.problems
    columns: list[Column] = []
    stamps, times = {}, {}
    for topic, one in sorted(rows.items()):
        if not one.paths:
            continue
        one.sort()
        columns += one.columns(topic)
        received = np.array(one.received, np.int64)
        stamped = np.array(one.stamps, np.int64)
        stamps[topic] = stamped if np.all(stamped > 0) else received
        times[topic] = received
        if not np.all(stamped > 0):
            remarks.append(f"{topic}: its messages carry no stamp: the times of their reception are taken")
        if one.odd:
            remarks.append(
                f"{topic}: {counted(one.odd, 'message names', 'messages name')} other joints than the "
                "first and left out"
            )
    if not columns:
        why = f": {remarks[1]}" if len(remarks) > 1 else ""
        raise RecordingError(f"{path} holds no messages with numbers{why}: name another bag.")
    return Log(path, "ROS bag", tuple(columns), stamps, times, tuple(remarks))


class _Rows:
    """The messages of one topic, as numbers."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.paths: dict[str, Any] = {}
        self.joints: tuple[str, ...] = ()
        self.values: list[list[float]] = []
        self.stamps: list[int] = []
        self.received: list[int] = []
        self.odd = 0

    def add(self, message: Any, received: int) -> None:
        if not self.paths:
            self.paths, self.joints = getters(message), joints_of(message)
        if joints_of(message) != self.joints:
            self.odd += 1
            return
        try:
            self.values.append([get(message) for get in self.paths.values()])
        except IndexError:  # fewer entries than the first message had
            self.odd += 1
            return
        self.stamps.append(stamp_of(message))
        self.received.append(received)

    def sort(self) -> None:
        """In order of reception: files and chunks need not be in it."""
        received = np.array(self.received, np.int64)
        if np.any(np.diff(received) < 0):
            order = np.argsort(received, kind="stable").tolist()
            self.values = [self.values[i] for i in order]
            self.stamps = [self.stamps[i] for i in order]
            self.received = [self.received[i] for i in order]

    def columns(self, topic: str) -> list[Column]:
        table = np.array(self.values, dtype=np.float64)
        return [
            Column(f"{topic}:{path}", table[:, k].copy(), self._unit(path), topic, usual=self._usual(path))
            for k, path in enumerate(self.paths)
        ]

    def _usual(self, path: str) -> str:
        """The unit by REP 103 of a turning joint; a joint may be linear, so a mapping can say otherwise."""
        return _OF_JOINTS.get(path.partition("[")[0], "") if self.kind == "sensor_msgs/msg/JointState" else ""

    def _unit(self, path: str) -> str:
        """The unit by REP 103, where the type leaves no other."""
        return next((unit for part, unit in _UNITS if part in path), "")
