"""An identification experiment as a node: answers each state of one robot with the effort of its motors."""

from __future__ import annotations

from typing import Any, ClassVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context

from haptic_teleop_control.acquisition import ABORTED, ACQUISITION_PARAMETERS, Acquisition
from haptic_teleop_control.faults import SECOND_SENDER, SECOND_SENDER_SENTENCE
from haptic_teleop_control.node_tables import NODE_PARAMETERS
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.nodes.streams.joint_states import JointStatePublisher, JointStateReceiver
from haptic_teleop_control.nodes.streams.senders import Info, with_info
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.robot_faults import RobotFaults
from haptic_teleop_control.simulated_time.messages import ANSWERER, Tick

LONGEST_GAP = 1.0
"""s between two states, after which the robot is taken for one that was started anew."""


class AcquisitionNode(HapticNode):
    NAME = "acquisition"
    SUMMARY = "runs an identification experiment on one stage of the 2DSFJ or one axis of the Omni"
    TOPICS = (
        "subscribes sfj/joint_states or omni/joint_states    each state is answered",
        "publishes  sfj/effort_command or omni/effort_command  N·m, zero but for the chosen joint",
        "publishes  reference        the signal: the torque at the joint (effort, N·m) or its position",
        "subscribes /diagnostics     whether the robot has a fault of its own",
        "service    ~/reset          std_srvs/Trigger: leave a fault; an experiment that ended stays so",
    )
    FAULTS: ClassVar = {
        "limit": "a limit was exceeded and the experiment was aborted; look at the recording, then "
        "begin a new experiment with a smaller signal or wider limits",
        "state": "a state had wrong joints or values that are no numbers; look at its publisher",
        "robot_fault": "the robot had a fault of its own and the experiment was aborted; see to that, reset "
        "the robot, then begin a new experiment",
        "stale_state": "the states stopped and came back, and the experiment was aborted; look whether the "
        "robot's driver was started anew",
        SECOND_SENDER: SECOND_SENDER_SENTENCE,
    }
    TABLE = ParameterTable("acquisition", [*ACQUISITION_PARAMETERS, *NODE_PARAMETERS])

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        self._experiment = experiment = Acquisition(self.values, self.NAME)
        for warning in experiment.warnings:
            self.get_logger().warning(warning)
        robot = experiment.robot
        self._robot_faults = RobotFaults(robot)
        self.create_subscription(DiagnosticArray, "/diagnostics", with_info(self._on_diagnostics), 10)
        self._first: int | None = None
        self._last = 0
        commands = f"{robot}/effort_command"
        self._out = JointStatePublisher(self, commands, experiment.motors, ("effort",), command=True)
        field = "position" if experiment.closed else "effort"
        self._reference = JointStatePublisher(self, "reference", (experiment.driven,), (field,))
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
        self.take_part(ANSWERER, topics=(self._in.topic,))

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        if repeated and self._out.sent:
            self._out.resend()
            self._reference.resend()
        if repeated and self._in.topic in tick.states:
            if self._last == tick.stamp:
                self.time.done()
            else:
                self.time.waiting(self._in.topic)

    def on_time_fault(self, detail: str) -> None:
        super().on_time_fault(detail)
        self._effort[:] = 0.0
        self._out.send_last_word()

    def _newer(self, stamp: int, received: int) -> bool:
        if stamp == self._last and self.time.simulated:
            self._out.resend()
        return stamp > self._last

    def _on_state(self) -> None:
        stamp, before = self._in.stamp, self._last
        self._last = stamp
        if self._first is None:
            self._first = before = stamp
        experiment, value = self._experiment, self._in.value
        if stamp - before > LONGEST_GAP * 1e9:
            self._end("stale_state", f"{self._in.topic} was silent for {(stamp - before) * 1e-9:.1f} s")
        if self.faults.latched:
            self._out.send_zero(stamp)
            return
        ended = experiment.phase == ABORTED
        time = (stamp - self._first) * 1e-9
        self._effort[:] = experiment.step(time, value["position"], value["velocity"])
        self._out.send(stamp)
        self._signal[0] = experiment.published
        self._reference.send(stamp)
        if experiment.phase == ABORTED and not ended:
            self.fault("limit", experiment.sentence)

    def _on_problem(self, kind: str, detail: str, stamp: int) -> None:
        if kind == SECOND_SENDER:  # the state at hand is good, and is answered: with zero from now on
            self._experiment.abort(detail)
            self.fault(kind, detail)
            return
        self._experiment.abort(detail)
        self.fault("state", detail)
        self._out.send_zero(stamp)

    def _on_diagnostics(self, message: DiagnosticArray, info: Info) -> None:
        if not self._in.shares_process(info):
            return  # a stray node of the same name
        for status in message.status:
            sentence = status.message if status.level == DiagnosticStatus.ERROR else None
            values = {entry.key: entry.value for entry in status.values}
            problem = self._robot_faults.step(status.name, sentence, values)
            if problem is not None:
                self._end("robot_fault", problem)

    def _end(self, fault: str, detail: str) -> None:
        """Zero at once; not even a reset lets the signal go on in its middle."""
        if self._experiment.abort(detail):
            if self._first is not None and not self.time.simulated:  # where the next state is soon enough
                self._out.send_zero(self._last)
            self.fault(fault, detail)

    def on_reset(self) -> None:
        self._in.forget()

    def state(self) -> str:
        return self._experiment.phase

    def shutdown_safely(self) -> None:
        if not self.time.simulated and self._out.sent:  # simulated, the robot moves by an answer only
            self._out.send_zero(self.time.stamp())
        self.time.close()


NODE = AcquisitionNode


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
