"""Simulated time of the force controller: which states of a tick are answered, when, and in which order.

The order is that of lockstep, so that both give the same numbers: the master first, and each state only when
the references and the packets of the link that come before it are there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from haptic_teleop_control.nodes.controller.topics import LinkTopics, RobotTopics
from haptic_teleop_control.nodes.streams.joint_states import JointStateReceiver
from haptic_teleop_control.nodes.timing.time_base import TimeBase
from haptic_teleop_control.simulated_time.messages import Tick


class TickAnswers:
    """Answers the states of each tick. In real time there is no tick, and nothing is done.

    robots: both, ways: the directions of the link, if any. halted(): whether time has ended. answer(robot,
    stamp) answers the robot's newest state; deliver(way, effort, velocity, arrival, age) hands over a packet
    of the link, times in ns. reference_seen: stamp of the newest reference, ns.
    """

    def __init__(
        self,
        time: TimeBase,
        robots: Sequence[RobotTopics],
        ways: Sequence[LinkTopics],
        halted: Callable[[], bool],
        answer: Callable[[RobotTopics, int], None],
        deliver: Callable[[LinkTopics, Any, Any, int, int], None],
    ) -> None:
        self._time, self._robots, self._ways = time, robots, ways
        self._halted, self._answer, self._deliver = halted, answer, deliver
        self._tick: Tick | None = None
        self._order: Sequence[RobotTopics] = ()
        self._mine: list[RobotTopics] = []  # robots whose states of this tick are answered, in order
        self._reference: JointStateReceiver | None = None
        self.reference_seen = 0

    def bind(self, master: RobotTopics, slave: RobotTopics, reference: JointStateReceiver) -> None:
        """Take the roles of the robots, which set the order, and the reference to wait for."""
        self._order, self._reference = (master, slave), reference
        self._choose()

    def is_new(self, source: RobotTopics | LinkTopics, stamp: int) -> bool:
        """Whether a message with `stamp` (ns) is to be taken. A state comes a second time when its answer was
        lost: the answer is sent again."""
        if isinstance(source, LinkTopics):
            return stamp > source.last_stamp
        if stamp > source.last_stamp:
            source.last_stamp = stamp
            return True
        if stamp == source.answered:
            source.out.resend()
        return False

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        """Time has come to `tick`; repeated: something was lost, so what was sent last is sent again."""
        self._tick = tick
        self._choose()
        if repeated:
            for robot in self._robots:
                if robot.answered:
                    robot.out.resend()
            for way in self._ways:
                if way.sent:
                    way.out.resend()
        self.advance(repeated)

    def advance(self, repeated: bool = False) -> None:
        """Answer what can be answered; where `repeated`, tell the coordinator what is missing."""
        tick = self._tick
        if tick is None or self._halted():
            return
        news = False
        for robot in self._mine:
            if robot.answered == tick.stamp:
                continue
            lacking = robot.input.topic if robot.seen != tick.stamp else self._lacking(tick)
            if lacking:
                if repeated:
                    self._time.waiting(lacking)
                return
            self._deliver_packets(tick)
            self._answer(robot, tick.stamp)
            news = True
        # The plants report that they are done. We do where the link takes something of ours, and when asked.
        if self._mine and (repeated or (news and self._ways)):
            self._time.done({way.out.topic: way.sent for way in self._ways})

    def end(self) -> None:
        """Time has ended: zero to every state without an answer, then a last zero to every robot."""
        for robot in self._robots:
            if robot.seen > robot.answered:
                robot.answered = robot.seen
                robot.out.send_zero(robot.seen)
            robot.out.send_last_word()

    def _choose(self) -> None:
        states = () if self._tick is None else self._tick.states
        self._mine = [robot for robot in self._order if robot.input.topic in states]

    def _lacking(self, tick: Tick) -> str:
        """The first topic on which something is missing that is to be known before answering, or ""."""
        reference = self._reference
        if reference is not None and tick.newest.get(reference.topic, 0) > self.reference_seen:
            return reference.topic
        for way in self._ways:
            for name, sent, _ in tick.deliveries:
                if name == way.out.topic and sent > way.last_stamp and sent not in way.packets:
                    return way.input.topic
        return ""

    def _deliver_packets(self, tick: Tick) -> None:
        if not self._ways:
            return
        ways = {way.out.topic: way for way in self._ways}
        for name, sent, arrival in tick.deliveries:
            way = ways.get(name)
            if way is None or sent <= way.last_stamp:  # overtaken, or a second time
                continue
            way.last_stamp = sent
            self._deliver(way, *way.packets[sent], arrival, arrival - sent)
        for way in self._ways:
            way.packets = {sent: packet for sent, packet in way.packets.items() if sent > way.last_stamp}
