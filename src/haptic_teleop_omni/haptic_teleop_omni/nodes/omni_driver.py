"""The driver of the Phantom Omni as a node: same topics, units and limits as `omni_sim`."""

from __future__ import annotations

from typing import ClassVar

from haptic_teleop_control.device import Driver, Reporter
from haptic_teleop_control.nodes.base.driver_node import DriverNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.robots import OMNI_JOINTS
from haptic_teleop_control.warning_list import DEADLINE_SHARE
from haptic_teleop_omni.build import ALL_FAULTS, make_driver
from haptic_teleop_omni.settings import TABLE


class OmniDriverNode(DriverNode):
    NAME = "omni_driver"
    NAMESPACE = "omni"
    ROBOT = "omni"
    SUMMARY = "the Omni through OpenHaptics or hidapi, an emulated one with its operator, or a capture"
    TOPICS = (
        "subscribes effort_command  effort of the three axes, N·m",
        "publishes  joint_states    three joints, once calibrated: position, velocity, torque applied",
        "publishes  /diagnostics    rates, reports lost, calibration, limits, faults",
        "service    ~/reset         std_srvs/Trigger: leave a latched fault, open a lost device again",
    )
    JOINTS = OMNI_JOINTS
    COMMAND_JOINTS = OMNI_JOINTS
    FAULTS: ClassVar = {**DriverNode.FAULTS, **ALL_FAULTS}
    TABLE = TABLE

    def make_driver(self, reporter: Reporter) -> Driver:
        driver = make_driver(self.values, reporter, self._packet, self.session, self.clock, self.NAME)
        counter = driver.counter
        if counter is not None:
            self.warnings.watch(
                lambda: counter.lost,
                "reports of the device were lost",
                lambda: counter.lost + self.cycles,
                DEADLINE_SHARE,
            )
        self.warnings.watch(lambda: driver.malformed, "reports of the device were malformed")
        return driver

    def _packet(self, channel: str, data: bytes) -> None:
        if self.capture is not None:
            self.capture.add(channel, self.time.stamp(), data)


NODE = OmniDriverNode


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
