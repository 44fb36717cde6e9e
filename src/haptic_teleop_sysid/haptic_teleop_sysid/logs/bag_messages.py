"""The messages of a ROS bag of either generation, decompressed within the limits of `recording.expansion`.

ROS 2 bags are read as recordings are. ROS 1 bags are read by rosbags, whose decompression has no limit and is
replaced: a file of 11 kB would become 3 GB of memory.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import NamedTuple, Protocol

from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Chunk, Header, decompressors

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording.bag_folder import Bag, open_bag
from haptic_teleop_control.recording.expansion import Budget, Damaged, expand_chunk
from haptic_teleop_sysid.logs.bag_types import BagTypes
from haptic_teleop_sysid.logs.log import MOST_ROWS


class Message(NamedTuple):
    """A message: its topic and type, when it was received, ns, and its bytes."""

    topic: str
    kind: str
    received: int
    data: bytes


class BagMessages(Protocol):
    """What either generation of bags is to the reader of logs.

    topics    message type by topic; complete after the messages
    problems  sentences about what is odd; complete after the messages
    ros1      how messages are encoded
    """

    topics: dict[str, str]
    problems: list[str]
    ros1: bool

    def messages(self, select: Callable[[str, str], bool]) -> Iterator[Message]:
        """The messages of the topics (name, type) for which ``select`` holds, in order of time or not.
        Raises Damaged; RecordingError for more than MOST_ROWS, unread where the bag says their number."""
        ...


def bag_messages(path: Path, types: BagTypes, topics: Collection[str] | None) -> BagMessages:
    """The bag at ``path``, a file or a folder. RecordingError when there is none, or when it announces too
    many messages, on ``topics`` where given."""
    if path.is_file():
        with path.open("rb") as stream:
            if stream.read(7) == b"#ROSBAG":
                return _Ros1(path, types)
    bag = open_bag(path)
    wanted = (n for topic, n in bag.announced().items() if topics is None or topic in topics)
    _refuse_many(path, sum(wanted))
    return _Ros2(bag, types)


def _refuse_many(path: Path, count: int) -> None:
    """RecordingError for more messages than fit into memory as numbers."""
    if count > MOST_ROWS:
        raise RecordingError(
            f"{path} holds {count} messages, more than the {MOST_ROWS} that are taken: name the topics in a "
            "mapping, or cut a shorter one out of it."
        )


class _Ros2:
    ros1 = False

    def __init__(self, bag: Bag, types: BagTypes) -> None:
        self._bag = bag
        self._types = types
        self.topics = bag.types
        self.problems: list[str] = []

    def messages(self, select: Callable[[str, str], bool]) -> Iterator[Message]:
        """See `BagMessages`."""
        bag = self._bag
        counts: dict[str, int] = {}

        def chosen(topic: str, kind: str) -> bool:
            self.topics.setdefault(topic, kind)
            self._types.learn(kind, *bag.definition(kind))
            return select(topic, kind)

        taken = 0
        for batch in bag.batches(chosen):
            taken += 0 if batch.rows is None else batch.count
            _refuse_many(bag.path, taken)
            counts[batch.topic] = counts.get(batch.topic, 0) + batch.count
            for which, matrix in batch.rows or ():
                for i, row in zip(which.tolist(), matrix, strict=True):
                    yield Message(batch.topic, batch.kind, int(batch.received[i]), row.tobytes())
        if bag.lossy:
            raise RecordingError(
                f"{'; '.join(bag.problems[:3])}: `haptic-teleop recover` makes a bag of what is whole in an "
                ".mcap file."
            )
        bag.check_counts(counts)
        self.problems = bag.problems


class _Ros1:
    ros1 = True

    def __init__(self, path: Path, types: BagTypes) -> None:
        self._path = path
        self._types = types
        self.topics: dict[str, str] = {}
        self.problems: list[str] = []

    def messages(self, select: Callable[[str, str], bool]) -> Iterator[Message]:
        """See `BagMessages`."""
        # An index can name the same message any number of times.
        budget = Budget(self._path.stat().st_size)
        try:
            with _Reader(self._path) as reader:
                self.topics = {c.topic: c.msgtype for c in reader.connections}
                for c in reader.connections:
                    self._types.learn(c.msgtype, "ros2msg", c.msgdef.data)
                wanted = [c for c in reader.connections if select(c.topic, c.msgtype)]
                _refuse_many(self._path, sum(c.msgcount for c in wanted))
                for connection, received, data in reader.messages(wanted) if wanted else ():
                    budget.take(len(data))
                    yield Message(connection.topic, connection.msgtype, received, data)
        except (ReaderError, OSError, ValueError, KeyError, IndexError, AssertionError, EOFError) as error:
            raise Damaged(str(error)) from error
        except (UnicodeError, OverflowError, TypeError) as error:
            raise Damaged(f"its records make no sense ({error})") from error


class _Reader(Reader):
    """rosbags' reader of ROS 1; its chunks expand to what they announce, and to no more than they may."""

    def read_chunk(self) -> Chunk:
        """The chunk at the place where the file stands."""
        assert self.bio is not None
        start = self.bio.tell()
        size = Header.read(self.bio).get_uint32("size")
        self.bio.seek(start)
        chunk = super().read_chunk()
        name = next(name for name, function in decompressors.items() if function is chunk.decompressor)
        if name == "none":
            return chunk
        # A budget for each time: chunks that overlap in time are expanded many times over.
        return chunk._replace(
            decompressor=lambda stored: expand_chunk(name, stored, size, Budget(len(stored)))
        )
