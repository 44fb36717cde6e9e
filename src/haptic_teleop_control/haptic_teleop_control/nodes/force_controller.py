"""The force controller of scenario 1 as a node: master's position in, slave's current and master's torque
out.

The slave's state drives the loop: each state is answered with a command that carries the state's stamp, so
that age and loop latency can be read from any recording. Whatever is wrong with an input, an answer still
goes out: zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from rclpy.context import Context

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LAWS, LawResult, MasterSide
from haptic_teleop_control.node_tables import AXES, FORCE_CONTROLLER
from haptic_teleop_control.nodes.base import HapticNode
from haptic_teleop_control.nodes.joint_state_io import FIELDS, JointStatePublisher, JointStateReceiver
from haptic_teleop_control.nodes.spin import run_node
from haptic_teleop_control.robots import (
    OMNI_JOINTS,
    OMNI_PEAK_TORQUE,
    SFJ_JOINTS,
    SFJ_MOTOR_JOINTS,
    STAGES,
)

# Slices, not lists of indices: they give views of the receivers' arrays, made once and valid for every
# sample.
AXIS_SLICE, MOTOR_SLICE, ARM_SLICE = slice(1, 3), slice(0, 4, 2), slice(1, 4, 2)
assert OMNI_JOINTS[AXIS_SLICE] == AXES
assert SFJ_JOINTS[MOTOR_SLICE] == SFJ_MOTOR_JOINTS
SATURATED, REFUSED_INPUT = int(LawResult.SATURATED), int(LawResult.REFUSED_INPUT)

NON_FINITE_STATE, MALFORMED_STATE, TIME_JUMP = "non_finite_state", "malformed_state", "time_jump"
STALE_REFERENCE, STALE_MASTER, STALE_SLAVE = "stale_reference", "stale_master", "stale_slave"
FAULTS = {
    NON_FINITE_STATE: "a state or reference held a value that is not a finite number; look at its publisher",
    MALFORMED_STATE: "a state or reference had wrong joint names or number of values; look at its publisher",
    TIME_JUMP: "the stamps of a state went back by more than the timeout; look for a second publisher",
    STALE_REFERENCE: "the reference stopped; look whether the signal generator still runs",
    STALE_MASTER: "the master's state stopped; look whether its driver still runs",
    STALE_SLAVE: "the slave's state stopped; look whether its driver still runs",
}


class ForceController(HapticNode):
    NAME = "force_controller"
    SUMMARY = (
        "couples master and slave by the augmented-error force law, equations (25) to (32) of the thesis"
    )
    TOPICS = (
        "subscribes sfj/joint_states     the slave's state; each is answered",
        "subscribes omni/joint_states    the master's state",
        "subscribes reference            position of omni_y, omni_z (command_source: reference)",
        "publishes  sfj/effort_command   effort of both motors, N·m = current x nominal torque constant",
        "publishes  omni/effort_command  effort of the three axes, N·m: fictitious spring and feedback",
        "publishes  /diagnostics         rates, faults, saturations",
        "service    ~/reset              std_srvs/Trigger: leave a latched fault, ramp in again",
    )
    FAULTS = FAULTS
    TABLE = FORCE_CONTROLLER

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        values = self.values
        if (values["master"], values["slave"]) != ("omni", "sfj"):
            raise ConfigurationError(
                f"{self.NAME}: master {values['master']} with slave {values['slave']} comes with scenario 2; "
                "set master: omni and slave: sfj."
            )
        self._law = LAWS[values["law"]].from_parameters(values, STAGES, 1.0 / values["slave_rate"])
        # The same settings at the two rates: what the slave is asked for, and what the hand feels.
        self._wanted = MasterSide.from_parameters(values, AXES, 1.0 / values["slave_rate"])
        self._felt = MasterSide.from_parameters(values, AXES, 1.0 / values["master_rate"])
        self._take(values)
        self._timeout_ns = round(values["timeout"] * 1e9)
        self._engaged_at: int | None = None  # steady time at which the ramp began; None while waiting
        self._last_stamp = {"master": 0, "slave": 0}
        self.saturations = 0
        self.dropped = 0

        self._slave_out = JointStatePublisher(self, "sfj/effort_command", SFJ_MOTOR_JOINTS, ("effort",))
        self._master_out = JointStatePublisher(self, "omni/effort_command", OMNI_JOINTS, ("effort",))
        self._slave_effort = self._slave_out.view["effort"]
        self._reference = JointStateReceiver(
            self, "reference", AXES, ("position",), None, self._reference_problem
        )
        self._master = JointStateReceiver(
            self, "omni/joint_states", OMNI_JOINTS, ("position",),
            self._on_master, self._master_problem, partial(self._follows, "master"),
        )  # fmt: skip
        self._slave = JointStateReceiver(
            self, "sfj/joint_states", SFJ_JOINTS, FIELDS,
            self._on_slave, self._slave_problem, partial(self._follows, "slave"),
        )  # fmt: skip
        slave, master = self._slave.value, self._master.value
        self._motor_position, self._arm_position = (
            slave["position"][MOTOR_SLICE],
            slave["position"][ARM_SLICE],
        )
        self._motor_velocity, self._arm_torque = slave["velocity"][MOTOR_SLICE], slave["effort"][ARM_SLICE]
        self._device_position = master["position"][AXIS_SLICE]
        self._device_effort = self._master_out.view["effort"][AXIS_SLICE]
        self._from_reference = values["command_source"] == "reference"
        self._source = self._reference if self._from_reference else self._master
        self._commanded = self._reference.value["position"] if self._from_reference else self._device_position
        self.count_rate("slave states", lambda: self._slave.count)
        self.count_rate("master states", lambda: self._master.count)
        self.count_rate("references", lambda: self._reference.count)

    # One sample.

    def _on_slave(self) -> None:
        stamp, now = self._slave.stamp, self._slave.received
        scale = self._permitted(now)
        if scale is None:
            self._slave_out.send_zero(stamp)
            return
        desired, _ = self._wanted.step(self._commanded, self._arm_torque)
        current = self._law.step(desired, self._motor_position, self._arm_position, self._motor_velocity)
        results = self._law.results.tolist()
        if REFUSED_INPUT in results:
            self._disengage(NON_FINITE_STATE, f"{self._slave.topic}: the law's arithmetic overflowed")
            scale = 0.0
        elif SATURATED in results:
            self.saturations += 1
        np.multiply(current, self._torque_constant * scale, out=self._slave_effort)
        self._slave_out.send(stamp)

    def _on_master(self) -> None:
        stamp, now = self._master.stamp, self._master.received
        if self._engaged_at is not None and now - self._slave.received > self._timeout_ns:
            self._disengage(STALE_SLAVE, f"{self._slave.topic} is silent for {self._slave.age(now):.3f} s")
        if self._engaged_at is None:
            self._master_out.send_zero(stamp)
            return
        _, felt = self._felt.step(self._device_position, self._arm_torque)
        np.multiply(felt, self._ramp(now), out=self._device_effort)
        np.clip(self._device_effort, -OMNI_PEAK_TORQUE, OMNI_PEAK_TORQUE, out=self._device_effort)
        self._master_out.send(stamp)

    def _follows(self, robot: str, stamp: int, received: int) -> bool:
        """Whether a state is newer than the last; one that was overtaken on its way is dropped, and
        counted."""
        back = self._last_stamp[robot] - stamp
        if 0 <= back <= self._timeout_ns:
            self.dropped += 1
            return False
        self._last_stamp[robot] = stamp
        if back > 0:  # the new time is the time from now on, and the answer is zero
            self._disengage(TIME_JUMP, f"the {robot}'s, by {back * 1e-9:.3f} s")
        return True

    def _permitted(self, now: int) -> float | None:
        """Share of the output that may go out now, the ramp from 0 to 1; None while waiting or faulted."""
        source = self._source
        if self.faults.latched or not source.fresh:
            return None
        if now - source.received > self._timeout_ns:
            name = STALE_REFERENCE if self._from_reference else STALE_MASTER
            self._disengage(name, f"{source.topic} is silent for {source.age(now):.3f} s")
            return None
        if self._engaged_at is None:
            self._engage(now)
        return self._ramp(now)

    def _ramp(self, now: int) -> float:
        elapsed = (now - (self._engaged_at or now)) * 1e-9
        return 1.0 if elapsed >= self._ramp_time else elapsed / self._ramp_time

    # Faults, start and end.

    def _engage(self, now: int) -> None:
        self._law.reset()
        self._wanted.reset()
        self._felt.reset()
        self._engaged_at = now

    def _disengage(self, name: str, detail: str) -> None:
        self.fault(name, detail)
        self._engaged_at = None

    def _reference_problem(self, kind: str, detail: str, stamp: int) -> None:
        self._disengage(NON_FINITE_STATE if kind == "non_finite" else MALFORMED_STATE, detail)

    def _slave_problem(self, kind: str, detail: str, stamp: int) -> None:
        self._reference_problem(kind, detail, stamp)
        self._slave_out.send_zero(stamp)

    def _master_problem(self, kind: str, detail: str, stamp: int) -> None:
        self._reference_problem(kind, detail, stamp)
        self._master_out.send_zero(stamp)

    def on_reset(self) -> None:
        self._engaged_at = None
        for receiver in (self._reference, self._master, self._slave):
            receiver.forget()

    def _take(self, values: Mapping[str, Any]) -> None:
        self._torque_constant = self._law.torque_constant
        self._ramp_time = values["ramp_time"]
        felt = [axis for axis in AXES if values[f"{axis}.feedback_gain"] > 0.0]
        if felt and values["command_source"] == "reference":
            self.get_logger().warning(
                f"feedback is on for {', '.join(felt)} while the reference commands and nobody holds the "
                "device; set feedback_gain to 0 unless that is meant"
            )

    def apply_parameters(self, values: Mapping[str, Any]) -> None:
        self._law.update(values, STAGES)
        self._wanted.update(values, AXES)
        self._felt.update(values, AXES)
        self._take(values)

    def state(self) -> str:
        if self.faults.latched:
            return "fault"
        if self._engaged_at is not None:
            return "engaged"
        return f"waiting for {self._source.topic}"

    def measurements(self) -> dict[str, Any]:
        return {"saturated samples": self.saturations, "late or repeated samples dropped": self.dropped}

    def shutdown_safely(self) -> None:
        self._slave_out.send_zero(self._last_stamp["slave"])
        self._master_out.send_zero(self._last_stamp["master"])


NODE = ForceController


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
