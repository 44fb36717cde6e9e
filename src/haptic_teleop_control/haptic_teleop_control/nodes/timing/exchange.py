"""How announcements and reports of simulated time travel: within a process by calls, between processes by
topics.

A process of several nodes would otherwise spend half of its time on messages to itself.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any
from weakref import WeakKeyDictionary

from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from haptic_teleop_control.simulated_time.messages import (
    RECORDER,
    REPORT_TOPIC,
    STATUS_TOPIC,
    TICK_TOPIC,
    Member,
    Report,
    Status,
    Tick,
    decode,
    encode,
)

QOS = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, history=HistoryPolicy.KEEP_LAST, depth=100)
LONGEST_TURN = 64
"""Calls in a row before the executor gets its turn again: services and signals are served between ticks."""


class _Process:
    """The participants and the coordinator of one process. Calls are queued: what is said within a call is
    heard after it."""

    def __init__(self) -> None:
        self.coordinator: Callable[[Report], None] | None = None
        self.participants: dict[str, Callable[[Tick | Status], None]] = {}
        self._queue: deque[tuple[Callable[[Any], None], Any]] = deque()
        self._running = False

    def call(self, hear: Callable[[Any], None], message: Tick | Status | Report) -> None:
        self._queue.append((hear, message))
        if not self._running:
            self.run()

    def run(self) -> None:
        """What is queued, within bounds; the coordinator's timer calls this, too."""
        self._running = True
        try:
            for _ in range(LONGEST_TURN):
                if not self._queue:
                    break
                hear, message = self._queue.popleft()
                hear(message)
        finally:
            self._running = False


_PROCESSES: WeakKeyDictionary[Context, _Process] = WeakKeyDictionary()


def _process(node: Node) -> _Process:
    return _PROCESSES.setdefault(node.context, _Process())


class CoordinatorEnd:
    """The coordinator's: `announce`, and `hear` is called with every report, `hear_other` with every status,
    also its own."""

    def __init__(
        self, node: Node, hear: Callable[[Report], None], hear_other: Callable[[Status], None]
    ) -> None:
        self._process = _process(node)
        self._process.coordinator = hear
        self._ticks = node.create_publisher(String, TICK_TOPIC, QOS)
        self._status = node.create_publisher(String, STATUS_TOPIC, QOS)
        node.create_subscription(String, REPORT_TOPIC, self._receive, QOS)
        node.create_subscription(String, STATUS_TOPIC, self._receive, QOS)
        self._hear, self._hear_other = hear, hear_other

    def announce(self, message: Tick | Status, members: dict[str, Member]) -> None:
        here = self._process.participants
        for name, hear in list(here.items()):
            if isinstance(message, Status) or name in members:
                self._process.call(hear, message)
        if isinstance(message, Status):
            self._status.publish(String(data=encode(message)))
        elif any(m.name not in here and m.kind != RECORDER for m in members.values()):
            self._ticks.publish(String(data=encode(message)))

    def run(self) -> None:
        self._process.run()

    def close(self) -> None:
        self._process.coordinator = None

    def _receive(self, message: String) -> None:
        said = decode(message.data)
        if isinstance(said, Report):
            self._hear(said)
        elif isinstance(said, Status):
            self._hear_other(said)


class ParticipantEnd:
    """A participant's: `say`, and `hear` is called with every announcement."""

    def __init__(self, node: Node, member: Member, hear: Callable[[Tick | Status], None]) -> None:
        self._process = _process(node)
        self._name = member.name
        self._process.participants[member.name] = hear
        self._reports = node.create_publisher(String, REPORT_TOPIC, QOS)
        self._hear = hear
        node.create_subscription(String, STATUS_TOPIC, self._receive, QOS)
        if member.kind != RECORDER:
            node.create_subscription(String, TICK_TOPIC, self._receive, QOS)

    def say(self, report: Report) -> None:
        coordinator = self._process.coordinator
        if coordinator is None:
            self._reports.publish(String(data=encode(report)))
        else:
            self._process.call(coordinator, report)

    def close(self) -> None:
        self._process.participants.pop(self._name, None)

    def _receive(self, message: String) -> None:
        if self._process.coordinator is not None:
            return  # heard already
        announced = decode(message.data)
        if isinstance(announced, (Tick, Status)):
            self._hear(announced)
