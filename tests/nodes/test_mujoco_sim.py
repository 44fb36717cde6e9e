"""The 2DSFJ in MuJoCo as a node: it moves when told to and stops when nobody tells it anything any more."""

import time

import pytest
from ros_graph import Graph, Sink, Source, stamp_of

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")

from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_sim.nodes.mujoco_sim import MujocoSim


def test_it_answers_commands_on_the_topics_of_the_robot_and_stops_when_they_stop(graph: Graph):
    plant = graph.start(MujocoSim, timeout=0.2)
    states = Sink(graph, "/sfj/joint_states")
    command = Source(graph, "/sfj/effort_command", SFJ_MOTOR_JOINTS)
    graph.until(lambda: command.connected() and states.messages, what="discovery")
    answered, end = 0, time.monotonic() + 0.5
    while time.monotonic() < end:
        graph.executor.spin_once(timeout_sec=0.01)
        if len(states.messages) > answered:
            answered = len(states.messages)
            command.send(stamp=stamp_of(states.last), effort=[2.0, 0.4])
    assert tuple(states.last.name) == SFJ_JOINTS
    assert plant.faults.latched is None
    assert plant.robot.flow.all()
    assert min(states.last.position) > 0.0
    graph.until(lambda: plant.faults.latched == "stale_command", what="silence noticed")
    graph.until(lambda: not plant.robot.flow.any(), what="current to zero")
