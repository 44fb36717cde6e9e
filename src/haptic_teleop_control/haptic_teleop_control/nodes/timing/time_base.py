"""The time of a node: that of the wall, or simulated. Nothing else in a node asks a clock.

What serves the operator and the disk (diagnostics, flushing, liveness) runs on steady timers in both
(`steady_timer`); every duration of an experiment counts stamps.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.timer import Timer

from haptic_teleop_control.nodes.timing.exchange import ParticipantEnd
from haptic_teleop_control.simulated_time.messages import Member, Status, Tick
from haptic_teleop_control.simulated_time.participant import Participant
from haptic_teleop_control.simulated_time.runs import own_run
from haptic_teleop_control.simulated_time.stamps import ORIGIN


def _stream(reliability: ReliabilityPolicy, depth: int, liveliness: LivelinessPolicy) -> QoSProfile:
    return QoSProfile(
        reliability=reliability,
        durability=DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        liveliness=liveliness,
    )


LATEST_QOS = _stream(ReliabilityPolicy.BEST_EFFORT, 10, LivelinessPolicy.AUTOMATIC)
"""In real time, of commands and of what a node hears: best effort, because a late sample is worth nothing,
and so that no robot of simulated time hears these commands; depth 10, because depth 1 loses samples at every
hop under jitter (measured) and 10 adds no delay."""

OFFERED_QOS = _stream(ReliabilityPolicy.RELIABLE, 10, LivelinessPolicy.AUTOMATIC)
"""In real time, of all that is published but commands (REP 2003): who subscribes with rclpy's default hears
it, and a recorder misses nothing while it is no more than 10 samples behind. The publisher keeps its newest
samples and does not wait (measured with a subscriber that was stopped)."""

EVERY_QOS = _stream(ReliabilityPolicy.RELIABLE, 4000, LivelinessPolicy.MANUAL_BY_TOPIC)
"""In simulated time: nothing may be lost, and a recorder may be some hundred samples behind. The liveliness,
of no meaning without a lease, is what only nodes of simulated time offer: who asks for it does not hear
those that go by the wall."""

COMMANDS_QOS = _stream(ReliabilityPolicy.RELIABLE, 4000, LivelinessPolicy.AUTOMATIC)
"""In simulated time, of the commands that a robot hears: a node of one's own, with rclpy's default, is a
fault there and not silence."""

POLL = 0.05
"""s between two looks at the coordinator."""

SIMULATED_TIME = "simulated_time"
TIME_FAULTS = {SIMULATED_TIME: "simulated time has ended or was refused; start the scenario anew"}

SILENT = 3.0
"""s that a node waits for the coordinator before it says so: in a scenario all join within that."""

UNCOORDINATED = (
    "use_sim_time is true, and no coordinator of simulated time is here yet: start haptic-teleop "
    "time_coordinator, with this node among its participants"
)

_STEADY_TO_WALL = time.time_ns() - time.monotonic_ns()


def steady_timer(node: Node, period: float, work: Callable[[], None]) -> Timer:
    """A timer that neither `/clock` nor a clock that is set stops."""
    return node.create_timer(period, work, clock=Clock(clock_type=ClockType.STEADY_TIME))


class WallTime:
    """The steady clock for ages, watchdogs and deadlines; stamps are wall time counted by it since the
    process started, so that they never jump with the clock.

    Everything in a node that goes by the wall goes by this object, which a test may replace by one that it
    holds.
    """

    simulated = over = False

    def offered(self, command: bool) -> QoSProfile:
        """The quality of service of a topic of joint states that a node publishes."""
        return LATEST_QOS if command else OFFERED_QOS

    def wanted(self, command: bool) -> QoSProfile:
        """The quality of service of a topic of joint states that a node hears."""
        return LATEST_QOS

    def now(self) -> int:
        """ns of the clock by which ages and durations count."""
        return time.monotonic_ns()

    def stamp_at(self, moment: int) -> int:
        """The stamp of a moment of `now`, ns."""
        return moment + _STEADY_TO_WALL

    def stamp(self) -> int:
        """The stamp of now, ns."""
        return self.stamp_at(self.now())

    def sleep_until(self, moment: int) -> None:
        """Returns at `moment` of `now`, ns, or at once when that is past."""
        wait = moment - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait * 1e-9)

    def wait(self, changed: threading.Condition, moment: int | None) -> None:
        """Waits for `changed`, which the caller holds, but not beyond `moment` of `now`, ns; may return
        early."""
        changed.wait(None if moment is None else max(0.0, (moment - self.now()) * 1e-9))

    def when_joined(self, work: Callable[[], None]) -> None:
        """Calls `work` at once: this time is everybody's."""
        work()

    def close(self) -> None:
        pass


class SimulatedTime:
    """Time that the coordinator grants; it stands still between two ticks.

    To be used by the executor's thread alone.
    """

    simulated = True

    def __init__(self, node: Node, wall: WallTime) -> None:
        self._node, self._wall = node, wall
        self._end: ParticipantEnd | None = None
        self.participant: Participant | None = None
        self._told = False
        self._upon_joining: list[Callable[[], None]] = []

    def offered(self, command: bool) -> QoSProfile:
        return EVERY_QOS

    def wanted(self, command: bool) -> QoSProfile:
        return COMMANDS_QOS if command else EVERY_QOS

    def now(self) -> int:
        return ORIGIN if self.participant is None else self.participant.stamp

    def stamp_at(self, moment: int) -> int:
        return moment

    def stamp(self) -> int:
        return self.now()

    def take_part(
        self,
        member: Member,
        on_tick: Callable[[Tick, bool], None],
        on_fault: Callable[[str], None],
        on_refused: Callable[[str], None],
        on_status: Callable[[Status], None] = lambda status: None,
    ) -> None:
        """Joins the coordinator and is called with every tick (see `Participant`)."""
        assert self.participant is None
        self.participant = Participant(
            member, self._say, on_tick, on_fault, on_refused, on_status, self._joined, run=own_run()
        )
        self._end = ParticipantEnd(self._node, member, self.participant.hear)
        steady_timer(self._node, POLL, self._poll)

    def when_joined(self, work: Callable[[], None]) -> None:
        """Calls `work` as soon as the node takes part: what it would hear or say before is of a run that may
        not be its own."""
        if self.participant is not None and self.participant.joined:
            work()
        else:
            self._upon_joining.append(work)

    @property
    def waits_for(self) -> str:
        """What keeps time from beginning, in words; empty once it has begun."""
        return "the start" if self.participant is None else self.participant.waits_for

    @property
    def over(self) -> bool:
        """Whether the coordinator has said that time is over."""
        return self.participant is not None and self.participant.over

    def done(self, stamps: Mapping[str, int] | None = None, silent: bool = False) -> None:
        if self.participant is not None:
            self.participant.done(stamps, silent)

    def waiting(self, what: str) -> None:
        if self.participant is not None:
            self.participant.waiting(what)

    def close(self) -> None:
        """Takes no part any more."""
        if self.participant is not None and self._end is not None:
            self.participant.leave()
            self._end.close()

    def _joined(self) -> None:
        works, self._upon_joining = self._upon_joining, []
        for work in works:
            work()

    def _say(self, report) -> None:
        if self._end is not None:
            self._end.say(report)

    def _poll(self) -> None:
        if self.participant is None:
            return
        self.participant.poll(self._wall.now() * 1e-9)
        if self.participant.waited > SILENT and not self._told:
            self._told = True
            self._node.get_logger().info(UNCOORDINATED)


TimeBase = WallTime | SimulatedTime
