"""The teleoperation as a node: states of both robots in, efforts for both out.

Each state is answered with a command that carries the state's stamp, so that age and loop latency can be read
from any recording. Whatever is wrong with an input, an answer still goes out: zero. What is computed is
`teleoperation.coupling`, the same as in lockstep; which robot is master is a parameter.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import find_law
from haptic_teleop_control.node_tables import FORCE_CONTROLLER
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.nodes.controller.report import energy_warning, measurements
from haptic_teleop_control.nodes.controller.ticks import TickAnswers
from haptic_teleop_control.nodes.controller.topics import JOINTS, LinkTopics, RobotTopics
from haptic_teleop_control.nodes.signal_generator import PATTERN, RUNNING
from haptic_teleop_control.nodes.streams.joint_states import (
    NON_FINITE,
    SECOND_SENDER,
    WRONG_JOINTS,
    JointStateReceiver,
)
from haptic_teleop_control.nodes.streams.senders import Info, with_info
from haptic_teleop_control.nodes.timing.time_base import SIMULATED_TIME
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.simulated_time.messages import ANSWERER, Tick
from haptic_teleop_control.teleoperation.coupling import Coupling
from haptic_teleop_control.teleoperation.faults import FAULTS, MALFORMED_STATE, NON_FINITE_STATE, TIME_JUMP
from haptic_teleop_control.teleoperation.machine import State
from haptic_teleop_control.teleoperation.sides import REFERENCES
from haptic_teleop_control.warning_list import DEADLINE_SHARE

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Several states may be entered in one cycle, and a recording shall hold all of them."""

PROBLEMS = {NON_FINITE: NON_FINITE_STATE, WRONG_JOINTS: MALFORMED_STATE}

LAST_REPEATS, LAST_SPACING = 2, 20_000_000
"""Times that the last command, zero, is sent again, and ns between: the middleware may lose one, or all that
are sent at once by a process that ends, and no other follows it."""

ROLE_KEYS = ("master", "slave", "master_rate", "slave_rate")


class ForceController(HapticNode):
    NAME = "force_controller"
    SUMMARY = "couples master and slave by force control; which robot is which are parameters"
    TOPICS = (
        "subscribes sfj/joint_states     each state is answered",
        "subscribes omni/joint_states    each state is answered",
        "subscribes reference            reference mode: angles of omni_y, omni_z, or torques on the arms",
        "publishes  sfj/effort_command   effort of both motors, N·m = current x nominal torque constant",
        "publishes  omni/effort_command  effort of the three axes, N·m",
        "publishes  ~/state    std_msgs/String, latched: off | devices_ready | aligning | engaged | fault",
        "publishes  teleoperation/master, teleoperation/slave        with link: what goes into it",
        "subscribes link/teleoperation/master, link/teleoperation/slave   with link: what comes out of it",
        "subscribes /diagnostics         whether a robot has a fault of its own, and whether a pattern runs",
        "publishes  /diagnostics         rates, faults, saturations, energies at the ports, link's delay",
        "service    ~/engage             std_srvs/Trigger: couple, when both sides are aligned; else align",
        "service    ~/disengage          std_srvs/Trigger: end the coupling, ramp out",
        "service    ~/swap               std_srvs/Trigger: exchange master and slave, when not engaged",
        "service    ~/reset              std_srvs/Trigger: leave a latched fault, through aligning",
    )
    NOTES = ("law: s = Td - Te - lambda * velocity is held at zero (docs/contact.md)",)
    FAULTS = FAULTS
    TABLE = FORCE_CONTROLLER

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        self.dropped = 0
        self._warned = False
        self._begun = False
        self._state_out = self.create_publisher(String, "~/state", LATCHED)
        self._coupling = self._couple(self.values)
        self._timeout_ns = round(self.values["timeout"] * 1e9)
        self._robots = {
            name: RobotTopics(self, name, self._on_state, self._on_problem, self._follows) for name in JOINTS
        }
        self._ways = [
            LinkTopics(self, name, self._on_heard, partial(self._on_problem, None), self._follows)
            for name in (("master", "slave") if self.values["link"] else ())
        ]
        self._answers = TickAnswers(
            self.time, list(self._robots.values()), self._ways,
            lambda: self.faults.latched == SIMULATED_TIME, self._answer_state, self._deliver,
        )  # fmt: skip
        self._reference: JointStateReceiver | None = None
        self._bind(self._coupling)
        for act in (self._engage, self._disengage, self._swap):
            self.create_service(Trigger, f"~/{act.__name__.lstrip('_')}", act)
        self.create_subscription(DiagnosticArray, "/diagnostics", with_info(self._on_diagnostics), 10)
        # Where another controller of this name takes part already, its state is not ours to say.
        self.time.when_joined(lambda: self._publish_state(self._coupling.state))
        for name, robot in self._robots.items():
            self.count_rate(f"{name} states", lambda robot=robot: robot.input.count)
        self.warnings.watch(
            lambda: self.dropped,
            "states came late or repeatedly and were dropped",
            lambda: self.dropped + sum(robot.input.count for robot in self._robots.values()),
            DEADLINE_SHARE,
        )
        self.count_rate("references", lambda: self._reference.count if self._reference else 0)

    def start(self) -> None:
        """Hears and answers from now on: what comes earlier is another graph's, and answering it would make
        two controllers of one robot."""
        self._begun = True
        for receiver in self._receivers():
            receiver.listen()
        states = tuple(robot.input.topic for robot in (self._master, self._slave))
        self.take_part(ANSWERER, topics=states, linked=bool(self._ways))

    def _receivers(self) -> list[JointStateReceiver]:
        assert self._reference is not None
        sources = (*self._robots.values(), *self._ways)
        return [*(source.input for source in sources), self._reference]

    def _couple(self, values: Mapping[str, Any]) -> Coupling:
        check_roles(values)
        law = None
        if values["slave"] == "sfj":
            law = find_law(values["law"]).from_parameters(values, STAGES, 1.0 / values["slave_rate"])
        coupling = Coupling(values, law, self.fault, self._publish_state)
        if coupling.master_port.feedback_gains.any() and values["command_source"] == "reference":
            held = f"feedback is on while a reference commands and nobody holds the {values['master']}"
            self.get_logger().warning(f"{held}; set feedback_gain to 0 unless that is meant")
        return coupling

    def _bind(self, coupling: Coupling) -> None:
        """Give the coupling the memory into which samples are received."""
        master, slave = coupling.roles
        coupling.robot_faults = self._coupling.robot_faults
        coupling.pattern_runs = self._coupling.pattern_runs
        self._coupling = coupling
        self._master, self._slave = self._robots[master], self._robots[slave]
        coupling.master, coupling.slave = self._master.views, self._slave.views
        joints, field = REFERENCES[master]
        if self._reference is not None:
            self._reference.destroy(self)
        self._reference = JointStateReceiver(
            self, "reference", joints, (field,), self._on_reference, self._on_bad_reference,
            silence=self.values["timeout"], listening=self._begun,
        )  # fmt: skip
        coupling.reference = self._reference.value[field]
        self._answers.bind(self._master, self._slave, self._reference)

    # One sample.

    def _on_state(self, robot: RobotTopics) -> None:
        if self.time.simulated:
            robot.seen = robot.input.stamp
            self._answers.advance()
        else:
            self._answer_state(robot, robot.input.received)

    def _answer_state(self, robot: RobotTopics, now: int) -> None:
        stamp, coupling = robot.input.stamp, self._coupling
        robot.answered = stamp
        if robot is self._slave:
            robot.effort[:] = coupling.on_slave(now)
            robot.out.send(stamp)
            if self._ways:
                self._ways[1].send(stamp, *coupling.to_master)
        else:
            robot.effort[:] = coupling.on_master(now)
            robot.out.send(stamp)
            if self._ways:
                self._ways[0].send(stamp, *coupling.to_slave)

    def _on_heard(self, way: LinkTopics) -> None:
        if self.time.simulated:
            way.keep()
            self._answers.advance()
            return
        now, value = way.input.received, way.input.value
        self._deliver(way, value["effort"], value["velocity"], now, self.time.stamp_at(now) - way.input.stamp)

    def _deliver(self, way: LinkTopics, effort: Any, velocity: Any, now: int, age: int) -> None:
        coupling = self._coupling
        first = 2 if way.backward else 0
        coupling.heard[first], coupling.heard[first + 1] = effort, velocity
        (coupling.on_backward if way.backward else coupling.on_forward)(now, age * 1e-9)

    # Simulated time.

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        self._answers.on_tick(tick, repeated)

    def on_time_fault(self, detail: str) -> None:
        now = self.time.now()
        self._coupling.fault(now, SIMULATED_TIME, detail, True)
        self._answers.end()

    # What is told beside the states.

    def _on_reference(self) -> None:
        assert self._reference is not None
        if self.time.simulated:
            stamp = self._answers.reference_seen = self._reference.stamp
            self._coupling.on_reference(stamp)
            self._answers.advance()
        else:
            self._coupling.on_reference(self.time.now())

    def _on_bad_reference(self, kind: str, detail: str, stamp: int) -> None:
        if kind == SECOND_SENDER:
            if self._coupling.from_reference:
                self._coupling.fault(self.time.now(), kind, detail)
            return
        self._coupling.on_bad_reference(self.time.now(), PROBLEMS[kind], detail)
        self._answers.reference_seen = max(self._answers.reference_seen, stamp)
        self._answers.advance()

    def _on_diagnostics(self, message: DiagnosticArray, info: Info) -> None:
        """Who runs where a robot's states come from speaks for it; a stray of the same name does not."""
        robots = [f"/{name}/" for name, robot in self._robots.items() if robot.input.shares_process(info)]
        for status in message.status:
            if any(robot in status.name for robot in robots):
                sentence = status.message if status.level == DiagnosticStatus.ERROR else None
                self._coupling.on_robot_fault(self.time.now(), status.name, sentence)
            pattern = next((told.value for told in status.values if told.key == PATTERN), None)
            if pattern is not None and self._reference is not None and self._reference.shares_process(info):
                self._coupling.pattern_runs = pattern == RUNNING

    def _follows(self, source: RobotTopics | LinkTopics, stamp: int, received: int) -> bool:
        """Whether a state is newer than the last; one that was overtaken on its way is dropped, and
        counted."""
        if self.time.simulated:
            return self._answers.is_new(source, stamp)
        back = source.last_stamp - stamp
        if 0 <= back <= self._timeout_ns or (back > 0 and isinstance(source, LinkTopics)):
            self.dropped += 1
            return False
        source.last_stamp = stamp
        if back > 0:  # the new time is the time from now on, and the answer is zero
            name = source.input.topic
            self._coupling.fault(received, TIME_JUMP, f"{name}, by {back * 1e-9:.3f} s", True)
        return True

    def _on_problem(self, robot: RobotTopics | None, kind: str, detail: str, stamp: int) -> None:
        if kind == SECOND_SENDER:  # the sample at hand is good, and is answered: with zero, or what fades
            self._coupling.fault(self.time.now(), kind, detail)
            return
        name = PROBLEMS[kind]
        self._coupling.fault(self.time.now(), name, detail, robot is self._slave)
        if robot is not None:
            robot.seen = robot.answered = robot.last_stamp = stamp
            robot.out.send_zero(stamp)
            if self.time.simulated:
                self._answers.advance(True)

    # What the operator does.

    def _engage(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        obstacle = self._coupling.engage(self.time.now())
        if obstacle and self._coupling.state is State.FAULT:
            obstacle = f"{obstacle}, with `{self._reset_command}` ({self.faults.sentence})"
        return self._answer(response, obstacle is None, obstacle or "engaged")

    @property
    def _reset_command(self) -> str:
        usual = self.full_name == f"/{self.NAME}"
        return f"haptic-teleop operate reset{'' if usual else f' --controller {self.full_name}'}"

    def _disengage(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        done = self._coupling.disengage(self.time.now())
        return self._answer(response, done, "disengaged" if done else "nothing was engaged")

    def _swap(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        now = self.values
        swapped = zip(ROLE_KEYS, ("slave", "master", "slave_rate", "master_rate"), strict=True)
        result = self.set_parameters_atomically([Parameter(key, value=now[old]) for key, old in swapped])
        done = f"master {self.values['master']}, slave {self.values['slave']}"
        if self.values["command_source"] == "reference":
            joints, field = REFERENCES[self.values["master"]]
            done += f"; the artificial command must now be the {field} of {' and '.join(joints)}"
        return self._answer(response, result.successful, done if result.successful else result.reason)

    def _answer(self, response: Trigger.Response, success: bool, message: str) -> Trigger.Response:
        response.success, response.message = success, message
        self.get_logger().info(message)
        return response

    def on_reset(self) -> None:
        for receiver in self._receivers():
            receiver.forget()
        self._coupling.reset(self.time.now())

    def apply_parameters(self, values: Mapping[str, Any]) -> None:
        changed = [key for key in ROLE_KEYS if values[key] != self.values[key]]
        if not changed:
            self._coupling.update(values)
            return
        if not self._coupling.machine.may_change_roles:
            raise ConfigurationError(
                f"{self.NAME}: {changed[0]} cannot change in the state {self._coupling.state.value}; "
                "disengage or reset first."
            )
        self._bind(self._couple(values))
        self._publish_state(State.OFF)

    def _publish_state(self, state: State) -> None:
        self._state_out.publish(String(data=state.value))

    def state(self) -> str:
        coupling = self._coupling
        if coupling.state in (State.ENGAGED, State.FAULT):
            return coupling.state.value
        return f"{coupling.state.value}: {coupling.obstacle(self.time.now()) or 'aligned'}"

    def measurements(self) -> dict[str, Any]:
        coupling, warning = self._coupling, energy_warning(self._coupling)
        if warning and not self._warned:  # once for each coupling
            self.get_logger().warning(warning)
        self._warned = bool(warning)
        self.warnings.state("energy", warning)
        failed = ", ".join(coupling.robot_faults)
        self.warnings.state("robots", f"in a fault of its own: {failed}" if failed else "")
        return measurements(coupling, self.dropped)

    def shutdown_safely(self) -> None:
        if not self.time.simulated:  # there a robot moves by an answer only, and every state has had its own
            commanded = [robot.out for robot in self._robots.values() if robot.out.sent]
            for out in commanded:
                out.send_zero(self.time.stamp())
            for _ in range(LAST_REPEATS if commanded else 0):
                self.time.sleep_until(self.time.now() + LAST_SPACING)
                for out in commanded:
                    out.resend()
        self.time.close()


def check_roles(values: Mapping[str, Any]) -> None:
    """Raises ConfigurationError where one robot would be both."""
    if values["master"] == values["slave"]:
        raise ConfigurationError(
            f"{ForceController.NAME}: master and slave are both {values['master']}; change both at once, or "
            "call ~/swap."
        )


NODE = ForceController


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
