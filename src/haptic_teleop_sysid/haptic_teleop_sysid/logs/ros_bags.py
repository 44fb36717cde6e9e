"""ROS bags of either generation, in any storage that rosbags reads, as columns `topic:field`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sysid.logs.log import MOST_ROWS, Column, Log
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
    store = get_typestore(Stores.ROS2_KILTED)
    extra: dict[str, Any] = {}
    for file in definitions:
        extra.update(_definition(file))
    if extra:
        store.register(extra)
    try:
        with AnyReader([path], default_typestore=store) as reader:
            if extra:
                known = reader.typestore.fielddefs
                reader.typestore.register({n: t for n, t in extra.items() if n not in known})
            return _read(path, reader, topics)
    except (AnyReaderError, OSError, ValueError, KeyError, AssertionError, EOFError) as error:
        if isinstance(error, RecordingError):
            raise
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


def _read(path: Path, reader: AnyReader, topics: Sequence[str] | None) -> Log:
    connections = [c for c in reader.connections if topics is None or c.topic in topics]
    for topic in topics or ():
        if topic not in {c.topic for c in connections}:
            present = ", ".join(sorted({c.topic for c in reader.connections})) or "none"
            raise RecordingError(f"{path} has no topic {topic}: correct the mapping (it has {present}).")
    count = sum(c.msgcount for c in connections)
    if count > MOST_ROWS:
        raise RecordingError(
            f"{path} holds {count} messages, more than the {MOST_ROWS} that are taken: name the topics in a "
            "mapping, or cut a shorter one out of it."
        )
    known = reader.typestore.fielddefs
    unknown = sorted({f"{c.topic} ({c.msgtype})" for c in connections if c.msgtype not in known})
    rows: dict[str, _Rows] = {}
    large: Counter[str] = Counter()
    readable = [c for c in connections if c.msgtype in known]
    for connection, received, raw in reader.messages(connections=readable) if readable else ():
        if len(raw) > LARGE:
            large[connection.topic] += 1
            continue
        message = reader.deserialize(raw, connection.msgtype)
        rows.setdefault(connection.topic, _Rows(connection.msgtype)).add(message, received)
    remarks = ["read as a ROS bag, with the times of the messages' headers where they have one"]
    if unknown:
        remarks.append(
            f"not defined and passed over: {', '.join(unknown)}; give the definitions with --msg FILE.msg"
        )
    if large:
        remarks.append(f"passed over, messages of more than {LARGE} bytes: {', '.join(sorted(large))}")
    columns: list[Column] = []
    stamps, times = {}, {}
    for topic, one in sorted(rows.items()):
        if not one.paths:
            continue
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
