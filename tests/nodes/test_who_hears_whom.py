"""Qualities of service: who listens hears every stream, and a node of simulated time none of the wall."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_graph import Sink, Source
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.recording.recorded_topic import RecordedTopic
from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode
from haptic_teleop_control.nodes.streams.joint_states import FIELDS, JointStatePublisher, JointStateReceiver
from haptic_teleop_control.nodes.timing.time_base import EVERY_QOS, LATEST_QOS, OFFERED_QOS
from haptic_teleop_control.recorder_parameters import DIAGNOSTICS, JOINT_STATE
from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_sim.nodes.sfj_sim import SfjSim

DEFAULT = QoSProfile(depth=10)
"""What rclpy makes of `create_subscription(JointState, topic, callback, 10)`."""


def test_a_subscription_with_the_default_of_rclpy_hears_the_states_of_a_robot(graph):
    """It heard nothing by the wall: states were offered best effort."""
    plant = graph.start(SfjSim)
    heard = Sink(graph, "/sfj/joint_states", DEFAULT)
    graph.run_until(lambda: len(heard.messages) > 5)
    assert list(heard.last.name) == list(SFJ_JOINTS)
    assert heard.stamps == sorted(set(heard.stamps)) and plant.states.sent >= len(heard.messages)


def test_it_hears_the_reference(graph):
    graph.start(SignalGeneratorNode, signal__enabled=True, signal__delay=0.0)
    heard = Sink(graph, "/reference", DEFAULT)
    graph.run_until(lambda: len(heard.messages) > 5)


@pytest.mark.parametrize(("command", "qos", "heard"), [
    (False, DEFAULT, False), (False, LATEST_QOS, False), (True, DEFAULT, True), (True, LATEST_QOS, False),
])  # fmt: skip
def test_a_node_of_simulated_time_hears_of_the_wall_the_commands_of_a_node_of_ones_own(
    graph, command, qos, heard
):
    """Those with rclpy's default, which are a fault; not those of our nodes. By the wall all are heard."""
    simulated = graph.make(SfjSim, use_sim_time=True)
    names = SFJ_MOTOR_JOINTS
    own = JointStatePublisher(simulated, "/a", names, ("effort",), command)
    wall = Source(graph, "/a", names, qos)
    here = JointStateReceiver(simulated, "/a", names, ("effort",), command=command)
    there = JointStateReceiver(graph.probe, "/a", names, ("effort",), command=command)
    graph.until(lambda: own.subscribers == 2 and there.publishers == 2 and wall.connected())
    graph.listen()
    assert here.publishers == (2 if heard else 1)


@pytest.mark.parametrize(("kind", "simulated", "offers", "reliable", "of_simulated_time"), [
    (JOINT_STATE, False, [LATEST_QOS, OFFERED_QOS], False, False),
    (JOINT_STATE, False, [OFFERED_QOS, EVERY_QOS], True, False),
    (JOINT_STATE, True, [OFFERED_QOS], True, True),
    (DIAGNOSTICS, True, [LATEST_QOS, OFFERED_QOS], True, False),
    (DIAGNOSTICS, True, [LATEST_QOS], False, False),
])  # fmt: skip
def test_a_recorder_wants_what_its_publishers_serve(
    graph, kind, simulated, offers, reliable, of_simulated_time
):
    for qos in offers:
        graph.probe.create_publisher(JointState if kind == JOINT_STATE else DiagnosticArray, "/a", qos)
    topic = RecordedTopic(graph.probe, "/a", kind, 10, lambda *message: None, simulated)
    graph.until(lambda: len(graph.probe.get_publishers_info_by_topic("/a")) == len(offers))
    topic.follow()
    wanted = topic._subscription.qos_profile
    assert (wanted.reliability == ReliabilityPolicy.RELIABLE) is reliable
    assert (wanted.liveliness == EVERY_QOS.liveliness) is of_simulated_time


def test_a_listener_that_falls_behind_gets_the_newest(graph):
    """A stream keeps its newest samples and goes on, whoever does not take them."""
    out = JointStatePublisher(graph.probe, "/a", SFJ_JOINTS, FIELDS)
    slow = Sink(graph, "/a", DEFAULT)
    graph.until(slow.connected)
    for stamp in range(1, 5001):
        out.send(stamp)  # nobody spins
    graph.until(lambda: slow.messages and slow.stamps[-1] == 5000)
    assert len(slow.messages) <= 2 * DEFAULT.depth
