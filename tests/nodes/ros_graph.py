"""A small ROS graph inside a test: nodes under test and a probe, whose callbacks run when the test says
so."""

from __future__ import annotations

import threading
import time
from array import array
from collections.abc import Callable, Sequence

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import make_executor
from haptic_teleop_control.nodes.streams.joint_states import stamp_of
from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS, WallTime

DEADLINE = 10.0


class HeldTime(WallTime):
    """The wall's time for the nodes of a test, which stands still unless the test moves it: no machine is too
    slow for it. Threads that sleep by it are woken by `advance`."""

    def __init__(self) -> None:
        self._moment = time.monotonic_ns()
        self._changed = threading.Condition()
        self._asleep: dict[threading.Thread, tuple[threading.Condition, int | None]] = {}
        self._sleepers: set[threading.Thread] = set()  # whoever has slept
        self._released = False

    def now(self) -> int:
        return self._moment

    def sleep_until(self, moment: int) -> None:
        with self._changed:
            while self._moment < moment:
                self.wait(self._changed, moment)

    def wait(self, changed: threading.Condition, moment: int | None) -> None:
        thread = threading.current_thread()
        self._sleepers.add(thread)
        self._asleep[thread] = (changed, moment)
        try:
            # After the entry: `advance` moves time first and then wakes whom it finds there.
            if moment is None or (self._moment < moment and not self._released):
                changed.wait()
        finally:
            del self._asleep[thread]
        if self._released and moment is not None:
            self._moment = max(self._moment, moment)

    @property
    def settled(self) -> bool:
        """Whether all who sleep by this time do so now."""
        asleep = dict(self._asleep)
        due = any(moment is not None and moment <= self._moment for _, moment in asleep.values())
        return not due and all(thread in asleep for thread in list(self._sleepers) if thread.is_alive())

    @property
    def next_waking(self) -> int | None:
        """The moment at which the next one wakes; None when nobody will."""
        return min((moment for _, moment in dict(self._asleep).values() if moment is not None), default=None)

    def advance(self, seconds: float) -> None:
        """Lets `seconds` go by at once, as for a process that the machine has stopped."""
        self.advance_to(self._moment + round(seconds * 1e9))

    def advance_to(self, moment: int) -> None:
        self._moment = moment
        self._wake()

    def release(self) -> None:
        """Nobody holds it any more: whoever sleeps wakes, and it is then. For nodes that end."""
        self._released = True
        self._wake()

    def _wake(self) -> None:
        for changed in {id(changed): changed for changed, _ in dict(self._asleep).values()}.values():
            with changed:
                changed.notify_all()


class Graph:
    """wall: the time of all nodes but the probe. `until` runs callbacks and leaves it where it is, `run` and
    `run_until` move it."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.executor = make_executor(self.context)
        self.nodes: list[Node] = []
        self.wall = HeldTime()
        self.probe = self._add(Node("probe", context=self.context))

    def _add(self, node: Node) -> Node:
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def make(
        self, node_class: type[HapticNode], wall: WallTime | None = None, **parameters: object
    ) -> HapticNode:
        """A node with these parameters, names as in its table with `__` for dots; not yet started. wall: in
        place of the graph's."""
        overrides = [Parameter(name.replace("__", "."), value=value) for name, value in parameters.items()]
        wall = wall or self.wall
        return self._add(node_class(context=self.context, wall=wall, parameter_overrides=overrides))

    def start(
        self, node_class: type[HapticNode], wall: WallTime | None = None, **parameters: object
    ) -> HapticNode:
        node = self.make(node_class, wall, **parameters)
        node.start()
        return node

    def end(self, node: HapticNode) -> None:
        """Stops one node; the others go on."""
        self.nodes.remove(node)
        node.shutdown_safely()
        self.executor.remove_node(node)
        node.destroy_node()

    def until(self, condition: Callable[[], object], deadline: float = DEADLINE, what: str = "") -> object:
        """Runs callbacks until the condition holds; its value. Fails the test after `deadline` seconds."""
        end = time.monotonic() + deadline
        while time.monotonic() < end:
            value = condition()
            if value:
                return value
            self.executor.spin_once(timeout_sec=0.002)
        raise AssertionError(f"not within {deadline} s: {what or condition}")

    def listen(self, seconds: float = 0.1) -> None:
        """Runs callbacks for a while of the machine's time: what was sent arrives."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.005)

    def tick(self, limit: int | None = None) -> None:
        """Time goes on to the moment at which the next thread wakes, or to `limit`, ns; returns when all who
        woke sleep again."""
        self.until(lambda: self.wall.settled, what="all sleep")
        moments = [moment for moment in (self.wall.next_waking, limit) if moment is not None]
        if moments:
            self.wall.advance_to(min(moments))
        self.executor.spin_once(timeout_sec=0.0)
        self.until(lambda: self.wall.settled, what="all sleep again")

    def run(self, seconds: float) -> None:
        """`seconds` go by, and all that is due happens in between."""
        end = self.wall.now() + round(seconds * 1e9)
        while self.wall.now() < end:
            self.tick(end)

    def run_until(self, condition: Callable[[], object], seconds: float = 10.0, what: str = "") -> object:
        """Time goes by until the condition holds; its value. Fails the test after `seconds` of it."""
        end = self.wall.now() + round(seconds * 1e9)
        deadline = time.monotonic() + DEADLINE
        while self.wall.now() < end and time.monotonic() < deadline:
            if value := condition():
                return value
            self.tick()
        raise AssertionError(f"not within {seconds} s: {what or condition}")

    def call(self, service: str) -> Trigger.Response:
        client = self.probe.create_client(Trigger, service)
        self.until(client.service_is_ready, what=service)
        future = client.call_async(Trigger.Request())
        self.until(future.done, what=service)
        return future.result()

    def close(self) -> None:
        self.wall.release()
        for node in reversed(self.nodes):
            if isinstance(node, HapticNode):
                node.shutdown_safely()
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()


class Source:
    """Publishes joint states on a topic and remembers the stamps, which are the graph's time, each later than
    the one before. qos: of a stream in real time, where none is stated."""

    def __init__(
        self, graph: Graph, topic: str, names: Sequence[str], qos: QoSProfile = LATEST_QOS
    ) -> None:
        self.graph, self.names = graph, list(names)
        self.publisher = graph.probe.create_publisher(JointState, topic, qos)
        self.stamps: list[int] = []

    def send(self, stamp: int | None = None, **fields: Sequence[float]) -> int:
        """`names` may be given too; missing fields stay empty."""
        message = JointState(name=list(fields.pop("names", self.names)))
        if stamp is None:
            stamp = max(self.graph.wall.stamp(), self.stamps[-1] + 1 if self.stamps else 0)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        for field, values in fields.items():
            setattr(message, field, array("d", values))
        self.publisher.publish(message)
        self.stamps.append(stamp)
        return stamp

    def connected(self) -> bool:
        return self.publisher.get_subscription_count() > 0


class Sink:
    """Collects the joint states of a topic: (stamp, {name: ...} fields as lists)."""

    def __init__(self, graph: Graph, topic: str, qos: QoSProfile = LATEST_QOS) -> None:
        self.messages: list[JointState] = []
        self._first: dict[int, JointState] = {}  # of each stamp
        self.subscription = graph.probe.create_subscription(JointState, topic, self._collect, qos)

    def _collect(self, message: JointState) -> None:
        self.messages.append(message)
        self._first.setdefault(stamp_of(message), message)

    @property
    def stamps(self) -> list[int]:
        return [stamp_of(message) for message in self.messages]

    @property
    def last(self) -> JointState:
        return self.messages[-1]

    def answer_to(self, stamp: int) -> JointState | None:
        return self._first.get(stamp)

    def connected(self) -> bool:
        return self.subscription.get_publisher_count() > 0


class Commanded:
    """A plant or driver that samples its robot as time goes by, which the test moves, and whose states the
    test answers."""

    def __init__(
        self, graph: Graph, node: type[HapticNode], motors: Sequence[str], **parameters: object
    ) -> None:
        self.graph = graph
        self.node = graph.start(node, **parameters)
        self.states = Sink(graph, self.node.states.topic)
        self.command = Source(graph, self.node.commands.topic, motors)
        graph.until(lambda: self.command.connected() and self.states.connected(), what="discovery")
        self.state()

    def state(self) -> None:
        """Time goes by until the next state, which arrives."""
        sent = self.node.states.sent
        self.graph.run_until(lambda: self.node.states.sent > sent, what="a state")
        self.hear()

    def hear(self) -> None:
        """Every state that was published has arrived; the first was when the test listened already."""
        self.graph.until(lambda: len(self.states.messages) == self.node.states.sent, what="the states")

    def send(self, **fields: object) -> None:
        """A command, which arrives: it is taken, dropped, or a fault. Unless told otherwise it answers the
        last state."""
        self.send_by(self.command, **fields)

    def send_by(self, sender: Source, **fields: object) -> None:
        """The same from another sender, which may also be refused."""
        before = self._outcomes
        sender.send(**{"stamp": stamp_of(self.states.last), **fields})
        self.graph.until(lambda: self._outcomes > before, what="the command arrives")

    def answer(self, seconds: float, effort: Sequence[float]) -> None:
        """Answers every state for so long, as a controller would."""
        end = self.graph.wall.now() + round(seconds * 1e9)
        while self.graph.wall.now() < end:
            self.state()
            self.send(effort=effort)

    @property
    def _outcomes(self) -> int:
        node = self.node
        return node.commands.count + node.commands.refused + node.dropped + node.faults.total
