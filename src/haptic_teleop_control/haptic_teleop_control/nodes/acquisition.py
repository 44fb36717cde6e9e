"""An identification experiment as a node: answers each state of one robot with the effort of its motors."""

from __future__ import annotations

from typing import Any, ClassVar

from rclpy.context import Context

from haptic_teleop_control.acquisition import ABORTED, ACQUISITION_PARAMETERS, Acquisition
from haptic_teleop_control.faults import SECOND_SENDER, SECOND_SENDER_SENTENCE
from haptic_teleop_control.node_tables import REALTIME_PRIORITY
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.nodes.streams.joint_states import JointStatePublisher, JointStateReceiver
from haptic_teleop_control.parameters import ParameterTable


class AcquisitionNode(HapticNode):
    NAME = "acquisition"
    SUMMARY = "runs an identification experiment on one stage of the 2DSFJ or one axis of the Omni"
    TOPICS = (
        "subscribes sfj/joint_states or omni/joint_states    each state is answered",
        "publishes  sfj/effort_command or omni/effort_command  N·m, zero but for the chosen joint",
        "publishes  reference        the signal: current, torque (effort) or position",
        "service    ~/reset          std_srvs/Trigger: leave an abort, begin again",
    )
    FAULTS: ClassVar = {
        "limit": "a limit was exceeded and the experiment was aborted",
        "state": "a state had wrong joints or values that are no numbers; look at its publisher",
        SECOND_SENDER: SECOND_SENDER_SENTENCE,
    }
    TABLE = ParameterTable("acquisition", [*ACQUISITION_PARAMETERS, REALTIME_PRIORITY])

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        self._experiment = experiment = Acquisition(self.values, self.NAME)
        for warning in experiment.warnings:
            self.get_logger().warning(warning)
        robot = experiment.robot
        self._first: int | None = None
        self._last = 0
        self._out = JointStatePublisher(self, f"{robot}/effort_command", experiment.motors, ("effort",))
        field = "position" if experiment.closed else "effort"
        self._reference = JointStatePublisher(self, "reference", (experiment.joint,), (field,))
        self._signal = self._reference.view[field]
        self._effort = self._out.view["effort"]
        fields = ("position", "velocity")
        self._in = JointStateReceiver(
            self, f"{robot}/joint_states", experiment.joints, fields,
            self._on_state, self._on_problem, self._newer, listening=False,
        )  # fmt: skip
        self.count_rate("states", lambda: self._in.count)

    def start(self) -> None:
        self._in.listen()  # not before: another graph's states are not for this one to answer

    def _newer(self, stamp: int, received: int) -> bool:
        return stamp > self._last

    def _on_state(self) -> None:
        stamp = self._last = self._in.stamp
        if self._first is None:
            self._first = stamp
        experiment, value = self._experiment, self._in.value
        if self.faults.latched:
            self._out.send_zero(stamp)
            return
        time = (stamp - self._first) * 1e-9
        self._effort[:] = experiment.step(time, value["position"], value["velocity"])
        self._out.send(stamp)
        self._signal[0] = experiment.reference
        self._reference.send(stamp)
        if experiment.phase == ABORTED:
            self.fault("limit", experiment.sentence)

    def _on_problem(self, kind: str, detail: str, stamp: int) -> None:
        if kind == SECOND_SENDER:  # the state at hand is good, and is answered: with zero from now on
            self.fault(kind, detail)
            return
        self.fault("state", detail)
        self._out.send_zero(stamp)

    def on_reset(self) -> None:
        self._in.forget()
        self._experiment.reset()
        self._first = None

    def state(self) -> str:
        return self._experiment.phase

    def shutdown_safely(self) -> None:
        if self._out.sent:
            self._out.send_zero(self._last)


NODE = AcquisitionNode


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
