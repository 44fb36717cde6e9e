"""Qualities of service: who listens hears every stream, and a node of simulated time none of the wall."""

import pytest
from rclpy.qos import QoSProfile
from ros_graph import Sink, Source

from haptic_teleop_control.nodes.signal_generator import SignalGeneratorNode
from haptic_teleop_control.nodes.streams.joint_states import FIELDS, JointStatePublisher, JointStateReceiver
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


@pytest.mark.parametrize("command", [False, True])
def test_a_robot_hears_commands_of_either_kind_of_time_and_other_nodes_those_of_their_own(graph, command):
    """By the wall both are heard; a node of simulated time does not hear a stream that goes by the wall, but
    a robot hears such a command, which is a fault there."""
    simulated = graph.make(SfjSim, use_sim_time=True)
    names = SFJ_MOTOR_JOINTS
    own = JointStatePublisher(simulated, "/a", names, ("effort",), command)
    wall = Source(graph, "/a", names, DEFAULT)
    here = JointStateReceiver(simulated, "/a", names, ("effort",), command=command)
    there = JointStateReceiver(graph.probe, "/a", names, ("effort",), command=command)
    graph.until(lambda: own.subscribers == 2 and there.publishers == 2 and wall.connected())
    assert here.publishers == (2 if command else 1)


def test_nobody_waits_for_a_listener_that_is_stuck(graph):
    """A reliable stream keeps its newest samples and goes on, whoever does not take them."""
    out = JointStatePublisher(graph.probe, "/a", SFJ_JOINTS, FIELDS)
    stuck = Sink(graph, "/a", DEFAULT)
    graph.until(stuck.connected)
    for stamp in range(1, 5001):
        out.send(stamp)  # nobody spins
    graph.until(lambda: stuck.messages and stuck.stamps[-1] == 5000)
    assert len(stuck.messages) <= 2 * DEFAULT.depth
