"""Joint states in and out: as bytes where the layout is known, every sample checked where it enters.

All messages of one sender have the same layout, so that stamp and numbers are read and written in place: what
rclpy needs to make a message object of the bytes, and the reverse, is two thirds of a sample's way.

The quality of service is that of the node's time: in real time only the latest sample counts to a node, in
simulated time every one.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.streams.senders import PROCESS, process_of, publishers, with_info
from haptic_teleop_control.nodes.timing.time_base import TimeBase, WallTime
from haptic_teleop_control.recording.cdr_layout import STAMP
from haptic_teleop_control.recording.cdr_template import PUT_STAMP, Template, zeros
from haptic_teleop_control.senders import SenderGuard
from haptic_teleop_control.simulated_time.stamps import LAST_WORD

FIELDS = ("position", "velocity", "effort")
NANOSECONDS = 1_000_000_000

SENDER_SILENCE = 0.1
"""Seconds without a sample after which another publisher may take the sender's place, where nothing says
how long the topic may be silent."""

NON_FINITE, WRONG_JOINTS, SECOND_SENDER = "non_finite", "joints", "second_sender"
"""What may be wrong with a stream: kinds for `on_problem`."""

_WALL = WallTime()


def time_base(node: Node) -> TimeBase:
    """The time by which a node counts; any other node than ours lives by the wall."""
    return getattr(node, "time", _WALL)


def stamp_of(message: JointState) -> int:
    """header.stamp in ns."""
    stamp = message.header.stamp
    return stamp.sec * NANOSECONDS + stamp.nanosec


class JointStatePublisher:
    """Publishes joint states of fixed joints from one serialized message; to be used by one thread at a time.

    `fields` are those that the messages carry; `view[field]` is the message's own memory as a float64 array
    (joints,), to be filled in place before `send`. `command`: they command a robot.
    """

    # The numbers lie at multiples of 8 after the 4 bytes of the encapsulation; so do they in this memory.
    _PAD = 4

    def __init__(
        self, node: Node, topic: str, joints: Sequence[str], fields: Sequence[str], command: bool = False
    ) -> None:
        self.joints = tuple(joints)
        self._time = time_base(node)
        self._publisher = node.create_publisher(JointState, topic, self._time.offered(command))
        self.topic = self._publisher.topic_name
        message = zeros(self.joints, fields)
        memory = bytearray(self._PAD) + message
        self._message = memoryview(memory)[self._PAD :]
        at, size = Template(message, fields).at, len(self.joints)
        self.view = {
            field: np.frombuffer(memory, float, size, self._PAD + at[field].start) for field in fields
        }
        self._publish = self._publisher.publish
        self.sent = self._stamp = 0
        self._last_word = False

    @property
    def subscribers(self) -> int:
        return self._publisher.get_subscription_count()

    def send(self, stamp: int) -> None:
        """Publishes what the views hold with `stamp` (ns)."""
        PUT_STAMP(self._message, STAMP, *divmod(stamp, NANOSECONDS))
        self._publish(bytes(self._message))
        self.sent += 1
        self._stamp = stamp

    def resend(self) -> None:
        """Publishes what was sent last once more."""
        self._publish(bytes(self._message))

    def send_zero(self, stamp: int) -> None:
        """Publishes zeros in all fields with `stamp` (ns)."""
        for values in self.view.values():
            values.fill(0.0)
        self.send(stamp)

    def send_last_word(self) -> None:
        """Publishes zeros with a stamp of their own, once, if anything was sent and time is not over: what
        stays on the wire, and in a recording, where nobody grants simulated time any more."""
        if self.sent and not self._last_word and not self._time.over:
            self._last_word = True
            self.send_zero(self._stamp + LAST_WORD)


class JointStateReceiver:
    """The latest sample of one topic, checked and brought into the order of `joints`.

    Every message must name exactly `joints`, in any order, and hold one finite number per joint in each of
    `fields`; then `value[field]` (joints,), `stamp` (ns, from the header) and `received` (ns, by the node's
    time) are updated and `on_sample()` is called. Otherwise nothing is updated and `on_problem(kind,
    detail, stamp)` is called, with kind WRONG_JOINTS (wrong names or lengths) or NON_FINITE. A good sample
    that `accept(stamp, received)` refuses is left out without a word. `count` is the number of samples taken,
    `fresh` whether there was one since the start or `forget`.

    Samples are taken from one publisher only (`SenderGuard`). When another one sends, too, its samples are
    left out, `on_problem` is called with SECOND_SENDER and both names, and the first one's samples go on to
    be taken; `silence` (s) without any lets another take its place. Not `listening`, it takes nothing until
    `listen`; in simulated time, nothing until the node takes part. `command`: the samples command this node.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        joints: Sequence[str],
        fields: Sequence[str],
        on_sample: Callable[[], None] | None = None,
        on_problem: Callable[[str, str, int], None] | None = None,
        accept: Callable[[int, int], bool] | None = None,
        silence: float = SENDER_SILENCE,
        listening: bool = True,
        command: bool = False,
    ) -> None:
        self.joints = tuple(joints)
        self.stamp = 0
        self.received = 0
        self.count = 0
        self.fresh = False
        self._size = len(self.joints)
        # Copying between arrays of the standard library is an order of magnitude cheaper than into NumPy's,
        # so the memory belongs to those, and NumPy has views of it.
        self._memory = [(field, array("d", [0.0] * self._size)) for field in fields]
        self.value = {field: np.frombuffer(memory) for field, memory in self._memory}
        self._bytes = [(field, memoryview(memory).cast("B")) for field, memory in self._memory]
        self._template: Template | None = None  # of the last good message, where its order is ours
        self._names = list(joints)  # as in the last good message
        self._order: list[int] | None = None  # None: the message's order is ours
        self._on_sample = on_sample
        self._on_problem = on_problem or (lambda kind, detail, stamp: None)
        self._accept = accept
        self._listening = self._destroyed = False
        callback = with_info(self._receive)
        self._time = time_base(node)
        self._subscription = node.create_subscription(
            JointState, topic, callback, self._time.wanted(command), raw=True
        )
        self.topic = self._subscription.topic_name
        self._now = self._time.now
        self._sender = SenderGuard(round(silence * 1e9), lambda: publishers(node, self.topic), self._clash)
        if listening:
            self.listen()

    @property
    def publishers(self) -> int:
        return self._subscription.get_publisher_count()

    @property
    def refused(self) -> int:
        """Samples of a second sender that were left out."""
        return self._sender.refused

    def shares_process(self, info: Mapping[str, Any]) -> bool:
        """Whether a message comes from the process that publishes this topic; also while none is known."""
        sender, process = self._sender.sender, process_of(info)
        return sender is None or not process or sender[:PROCESS].hex() == process

    def listen(self) -> None:
        """Take samples from now on, in simulated time as soon as the node takes part."""
        self._time.when_joined(self._open)

    def age(self, now: int) -> float:
        """Seconds since the last good sample arrived, by the node's time; infinite before the first."""
        return (now - self.received) * 1e-9 if self.fresh else inf

    def forget(self) -> None:
        """Wait for the next sample as if none had been received, and none of a second sender."""
        self.fresh = False
        self.stamp = 0
        self._sender.forget()

    def destroy(self, node: Node) -> None:
        """Receive nothing any more, not even what the executor has taken already."""
        self._destroyed, self._listening = True, False
        node.destroy_subscription(self._subscription)

    def _open(self) -> None:
        self._listening = not self._destroyed

    def _receive(self, message: bytes | JointState, info: Mapping[str, Any]) -> None:
        if not self._listening:
            return
        received = self._now()
        told = info.get("publisher_gid")
        if told is not None:
            sender, identity = self._sender, told["data"]
            if identity == sender.sole:
                sender.heard = received
            elif not sender.admit(identity, received):
                return
        template = self._template
        if template is None or not template.fits(message):
            self._examine(message, received)
            return
        sec, nanosec, *values = template.read(message)
        if not isfinite(sum(values)):
            self._examine(message, received)
            return
        stamp = sec * NANOSECONDS + nanosec
        if self._accept is not None and not self._accept(stamp, received):
            return
        at = template.at
        for field, memory in self._bytes:
            memory[:] = message[at[field]]
        self._taken(stamp, received)

    def _examine(self, data: bytes | JointState, received: int) -> None:
        """A message of whatever layout; what is wrong with it is told."""
        message = _decoded(data)
        if message is None:
            self._on_problem(WRONG_JOINTS, f"{self.topic}: bytes that are no joint state", 0)
            return
        stamp = stamp_of(message)
        if message.name != self._names and not self._learn_order(message.name, stamp):
            return
        samples = []
        for field, memory in self._memory:
            values = getattr(message, field)
            if len(values) != self._size:
                found = f"{len(values)} values" if len(values) else "nothing"
                self._on_problem(
                    WRONG_JOINTS, f"{self.topic}: {field} holds {found} for {self._size} joints", stamp
                )
                return
            if not isfinite(sum(values)):
                self._on_problem(NON_FINITE, f"{self.topic}: {field} is {list(values)}", stamp)
                return
            samples.append((memory, values))
        if self._accept is not None and not self._accept(stamp, received):
            return
        for memory, values in samples:
            memory[:] = values if self._order is None else array("d", [values[i] for i in self._order])
        self._template = None if self._order is not None else self._learn(data)
        self._taken(stamp, received)

    def _learn(self, data: bytes | JointState) -> Template | None:
        try:
            return Template(data, list(self.value)) if isinstance(data, bytes) else None
        except ValueError:  # a representation that we cannot read in place; the middleware can
            return None

    def _taken(self, stamp: int, received: int) -> None:
        self.stamp = stamp
        self.received = received
        self.count += 1
        self.fresh = True
        if self._on_sample is not None:
            self._on_sample()

    def _clash(self, both: str) -> None:
        self._on_problem(SECOND_SENDER, f"{self.topic}: {both}", self.stamp)

    def _learn_order(self, names: Sequence[str], stamp: int) -> bool:
        if len(names) != self._size or set(names) != set(self.joints):
            self._on_problem(
                WRONG_JOINTS, f"{self.topic}: names {list(names)}, expected {list(self.joints)}", stamp
            )
            return False
        self._names = list(names)
        identity = tuple(names) == self.joints
        self._order = None if identity else [self._names.index(joint) for joint in self.joints]
        return True


def _decoded(data: bytes | JointState) -> JointState | None:
    """The message, or None for bytes that are none: what fails there is the middleware's own exception."""
    if isinstance(data, JointState):
        return data
    try:
        return deserialize_message(data, JointState)
    except Exception:
        return None
