"""The simulated 2DSFJ as a node: same topics, units, limits and quantisation as its driver."""

from __future__ import annotations

from haptic_teleop_control.node_tables import NODE_PARAMETERS
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_sim.hardware import SFJ_PARAMETERS, SfjRobot
from haptic_teleop_sim.nodes.plant_node import PlantNode


class SfjSim(PlantNode):
    NAME = "sfj_sim"
    NAMESPACE = "sfj"
    SUMMARY = "the simulated Quanser 2DSFJ"
    TOPICS = (
        "subscribes effort_command  effort of both motors, N·m = current x nominal torque constant",
        "publishes  joint_states    four joints: position, filtered velocity, effort",
        "publishes  /diagnostics    rates, loop latency, faults, periods skipped",
        "service    ~/reset         std_srvs/Trigger: leave a latched fault",
    )
    JOINTS = SFJ_JOINTS
    COMMAND_JOINTS = SFJ_MOTOR_JOINTS
    TABLE = ParameterTable(NAME, [*SFJ_PARAMETERS, *NODE_PARAMETERS])

    def make_robot(self, dt: float) -> SfjRobot:
        own = {name: value for name, value in self.values.items() if name in SFJ_PARAMETERS}
        return SfjRobot.from_parameters(own, dt, source=self.NAME)


NODE = SfjSim


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
