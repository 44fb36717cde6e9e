"""The driver of the Quanser 2DSFJ as a node: same topics, units, limits and quantisation as `sfj_sim`."""

from __future__ import annotations

from typing import ClassVar

from haptic_teleop_2dsfj.build import make_driver
from haptic_teleop_2dsfj.settings import TABLE
from haptic_teleop_2dsfj.supervisor import FAULTS
from haptic_teleop_control.device import Driver, Reporter
from haptic_teleop_control.nodes.base.driver_node import DriverNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.robots import SFJ_JOINTS, SFJ_MOTOR_JOINTS
from haptic_teleop_control.warning_list import DEADLINE_SHARE


class SfjDriverNode(DriverNode):
    NAME = "sfj_driver"
    NAMESPACE = "sfj"
    ROBOT = "sfj"
    SUMMARY = "the Quanser 2DSFJ through its HIL board, an emulated board, or a captured session"
    TOPICS = (
        "subscribes effort_command  effort of both motors, N·m = current x nominal torque constant",
        "publishes  joint_states    four joints: position, filtered velocity, effort",
        "publishes  /diagnostics    rates, samples missed, limits, faults",
        "service    ~/reset         std_srvs/Trigger: leave a latched fault, open a lost board again",
    )
    JOINTS = SFJ_JOINTS
    COMMAND_JOINTS = SFJ_MOTOR_JOINTS
    FAULTS: ClassVar = {**DriverNode.FAULTS, **FAULTS}
    TABLE = TABLE

    def make_driver(self, reporter: Reporter) -> Driver:
        driver = make_driver(self.values, reporter, self._packet, self.session, self.clock, self.NAME)
        self.warnings.watch(
            lambda: driver.missed,
            "samples of the board were missed",
            lambda: driver.missed + self.cycles,
            DEADLINE_SHARE,
        )
        return driver

    def _packet(self, channel: str, data: bytes) -> None:
        if self.capture is not None:
            self.capture.add(channel, self.time.stamp(), data)


NODE = SfjDriverNode


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
