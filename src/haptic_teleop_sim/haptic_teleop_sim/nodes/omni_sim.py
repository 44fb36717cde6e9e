"""The simulated Phantom Omni, and the hand that holds it, as a node."""

from __future__ import annotations

from haptic_teleop_control.node_tables import NODE_PARAMETERS
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.robots import OMNI_JOINTS
from haptic_teleop_sim.hardware import OMNI_PARAMETERS, OmniRobot
from haptic_teleop_sim.nodes.plant_node import PlantNode


class OmniSim(PlantNode):
    NAME = "omni_sim"
    NAMESPACE = "omni"
    SUMMARY = "the simulated Phantom Omni with an operator who holds it or moves it along a trajectory"
    TOPICS = (
        "subscribes effort_command  effort of the three axes, N·m",
        "publishes  joint_states    three joints: position, filtered velocity, torque applied last",
        "publishes  /diagnostics    rates, loop latency, faults, periods skipped",
        "service    ~/reset         std_srvs/Trigger: leave a latched fault",
    )
    JOINTS = OMNI_JOINTS
    COMMAND_JOINTS = OMNI_JOINTS
    PHASE = 0.5  # at 1 kHz halfway between two states of the 2DSFJ
    TABLE = ParameterTable(NAME, [*OMNI_PARAMETERS, *NODE_PARAMETERS])

    def make_robot(self, dt: float) -> OmniRobot:
        own = {name: value for name, value in self.values.items() if name in OMNI_PARAMETERS}
        return OmniRobot.from_parameters(own, dt, source=self.NAME)


NODE = OmniSim


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
