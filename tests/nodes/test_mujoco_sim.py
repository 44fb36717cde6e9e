"""The 2DSFJ in MuJoCo as a node: it moves when told to and stops when nobody tells it anything any more."""

import pytest
from ros_graph import Commanded, Graph

pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")

from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_sim.nodes.mujoco_sim import MujocoSim


def test_it_answers_commands_on_the_topics_of_the_robot_and_stops_when_they_stop(graph: Graph):
    setting = Commanded(graph, MujocoSim, SFJ_MOTOR_JOINTS)
    assert setting.states.subscription.topic_name == "/sfj/joint_states"
    setting.answer(0.5, [2.0, 0.4])
    plant = setting.node
    assert tuple(setting.states.last.name) == SFJ_JOINTS
    assert plant.faults.latched is None
    assert plant.robot.flow.all()
    assert min(setting.states.last.position) > 0.0
    graph.run_until(lambda: plant.faults.latched == "stale_command", what="silence noticed")
    setting.state()
    assert not plant.robot.flow.any()
