"""The 2DSFJ simulated by MuJoCo as a node: same topics, units, limits, quantisation and parameters as
`sfj_sim`."""

from __future__ import annotations

from haptic_teleop_control.node_tables import NODE_PARAMETERS
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_sim.hardware import SFJ_PARAMETERS
from haptic_teleop_sim.mujoco_robot import MujocoRobot
from haptic_teleop_sim.nodes.sfj_sim import SfjSim


class MujocoSim(SfjSim):
    NAME = "mujoco_sim"
    SUMMARY = "the Quanser 2DSFJ simulated by MuJoCo, in place of sfj_sim"
    TABLE = ParameterTable(NAME, [*SFJ_PARAMETERS, *NODE_PARAMETERS])

    def make_robot(self, dt: float) -> MujocoRobot:
        own = {name: value for name, value in self.values.items() if name in SFJ_PARAMETERS}
        return MujocoRobot.from_parameters(own, dt, source=self.NAME)


NODE = MujocoSim


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
