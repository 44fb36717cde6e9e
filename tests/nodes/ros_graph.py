"""A small ROS graph inside a test: nodes under test and a probe, whose callbacks run when the test says
so."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Sequence
from dataclasses import replace

import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from haptic_teleop_control.node_tables import FORCE_CONTROLLER
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import make_executor
from haptic_teleop_control.nodes.force_controller import ForceController
from haptic_teleop_control.nodes.streams.joint_states import STREAM_QOS, stamp_of
from haptic_teleop_control.parameters import ParameterTable

DEADLINE = 10.0


class PatientController(ForceController):
    """The controller with a `timeout` that a machine too busy for its tests does not reach."""

    TABLE = ParameterTable(
        FORCE_CONTROLLER.node_name,
        [replace(p, maximum=5.0) if p.name == "timeout" else p for p in FORCE_CONTROLLER],
        FORCE_CONTROLLER._brought,
    )


class Graph:
    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.executor = make_executor(self.context)
        self.nodes: list[Node] = []
        self.probe = self._add(Node("probe", context=self.context))
        self._clients: dict[str, object] = {}

    def _add(self, node: Node) -> Node:
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def start(self, node_class: type[HapticNode], **parameters: object) -> HapticNode:
        """A node with these parameters, names as in its table with `__` for dots."""
        overrides = [Parameter(name.replace("__", "."), value=value) for name, value in parameters.items()]
        node = self._add(node_class(context=self.context, parameter_overrides=overrides))
        node.start()
        return node

    def until(self, condition: Callable[[], object], deadline: float = DEADLINE, what: str = "") -> object:
        """Runs callbacks until the condition holds; its value. Fails the test after `deadline` seconds."""
        end = time.monotonic() + deadline
        while time.monotonic() < end:
            value = condition()
            if value:
                return value
            self.executor.spin_once(timeout_sec=0.01)
        raise AssertionError(f"not within {deadline} s: {what or condition}")

    def run(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.005)

    def call(self, service: str) -> Trigger.Response:
        client = self.probe.create_client(Trigger, service)
        self.until(client.service_is_ready, what=service)
        future = client.call_async(Trigger.Request())
        self.until(future.done, what=service)
        return future.result()

    def close(self) -> None:
        for node in reversed(self.nodes):
            if isinstance(node, HapticNode):
                node.shutdown_safely()
            self.executor.remove_node(node)
            node.destroy_node()
        self.executor.shutdown()
        self.context.try_shutdown()


class Source:
    """Publishes joint states on a topic and remembers the stamps."""

    def __init__(self, graph: Graph, topic: str, names: Sequence[str]) -> None:
        self.graph, self.names = graph, list(names)
        self.publisher = graph.probe.create_publisher(JointState, topic, STREAM_QOS)
        self.stamps: list[int] = []

    def send(self, stamp: int | None = None, **fields: Sequence[float]) -> int:
        """`names` may be given too; missing fields stay empty."""
        message = JointState(name=list(fields.pop("names", self.names)))
        stamp = time.time_ns() if stamp is None else stamp
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

    def __init__(self, graph: Graph, topic: str) -> None:
        self.messages: list[JointState] = []
        self._first: dict[int, JointState] = {}  # of each stamp
        self.subscription = graph.probe.create_subscription(JointState, topic, self._collect, STREAM_QOS)

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
