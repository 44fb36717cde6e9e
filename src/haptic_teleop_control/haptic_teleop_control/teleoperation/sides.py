"""The two sides of the teleoperation for either robot, behind one pair of interfaces: who is master and who
is slave is a matter of parameters.

All per-stage values are (2,), stage1 and stage2 or the axes paired with them. A robot's state is given as its
position, velocity and effort, each of all its joints in the order of `robots.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.laws import LawResult, MasterSide
from haptic_teleop_control.laws.contract import ForceLaw
from haptic_teleop_control.laws.omni_slave import OmniSlaveLaw
from haptic_teleop_control.laws.sfj_master import SfjMasterSide
from haptic_teleop_control.robots import OMNI_JOINTS, OMNI_PEAK_TORQUE, PAIRS, SFJ_JOINTS, STAGES

Array = NDArray[np.float64]
Values = Mapping[str, Any]

AXES = tuple(PAIRS[stage] for stage in STAGES)
# Slices, not lists of indices: they give views, made once and valid for every sample.
AXIS_SLICE, MOTOR_SLICE, ARM_SLICE = slice(1, 3), slice(0, 4, 2), slice(1, 4, 2)
assert OMNI_JOINTS[AXIS_SLICE] == AXES
assert SFJ_JOINTS[ARM_SLICE] == tuple(f"{stage}_arm" for stage in STAGES)

REFERENCES: dict[str, tuple[tuple[str, ...], str]] = {
    "omni": (AXES, "position"),
    "sfj": (SFJ_JOINTS[ARM_SLICE], "effort"),
}
"""By master: the joints of the artificial command, and its field: angles of the Omni, rad, or torques of the
hand on the arms, N·m."""

_SATURATED, _REFUSED = int(LawResult.SATURATED), int(LawResult.REFUSED_INPUT)


class MasterPort(Protocol):
    """What the operator holds."""

    saturated: bool
    """Whether a limit held in the last `torque`."""

    def desired(self, position: Array, velocity: Array, effort: Array) -> Array:
        """Td, N·m, from the device's state."""
        ...

    def desired_by(self, reference: Array) -> Array:
        """Td, N·m, from the artificial command that stands for the hand (see REFERENCES)."""
        ...

    def offset(self, position: Array) -> Array:
        """rad, how far the device is from its neutral position."""
        ...

    def offset_of(self, reference: Array) -> Array:
        """rad, how far the artificial command is from neutral."""
        ...

    def torque(
        self, position: Array, velocity: Array, effort: Array, feedback: Array, damping: Array
    ) -> Array:
        """Efforts of the robot's motors, N·m, for the slave's Te and an added torque on the hand."""
        ...

    def at_hand(self, velocity: Array, effort: Array, given: Array) -> tuple[Array, Array]:
        """Torque of the device on the hand since the last sample, N·m, and the velocity of the joint that the
        hand holds. given: the efforts that answered the last sample; what a device adds of its own to
        compensate itself is no part of what the hand is given."""
        ...

    @property
    def feedback_gains(self) -> Array: ...

    def reset(self) -> None: ...

    def update(self, values: Values) -> None:
        """Take changed parameters; raises ConfigurationError, and then has changed nothing."""


class SlavePort(Protocol):
    """What touches the environment."""

    saturated: bool
    refused: bool
    environment_torque: Array
    """Te, N·m, of the last `step` or `observe`: measured for the 2DSFJ, estimated for the Omni. A view."""

    def step(self, desired: Array, position: Array, velocity: Array, effort: Array) -> Array:
        """Efforts of the robot's motors, N·m."""
        ...

    def observe(self, position: Array, velocity: Array, effort: Array) -> None:
        """A sample at which nothing is driven."""

    def velocity(self, velocity: Array) -> Array:
        """rad/s, of the joints that touch the environment."""
        ...

    def reset(self) -> None: ...

    def update(self, values: Values) -> None:
        """As MasterPort.update."""


class OmniMaster:
    """Scenario 1: the device's angle asks for a torque; a virtual spring and the feedback are felt."""

    def __init__(self, values: Values, master_dt: float, slave_dt: float) -> None:
        # The same settings at the two rates: what the slave is asked for, and what the hand feels.
        self.wanted = MasterSide.from_parameters(values, AXES, slave_dt)
        self.felt = MasterSide.from_parameters(values, AXES, master_dt)
        self.saturated = False
        self._effort, self._nothing = np.zeros(3), np.zeros(2)
        self._effort_axes = self._effort[AXIS_SLICE]
        self._take()

    def _take(self) -> None:
        self._neutral = np.array([one.neutral for one in self.felt.settings])
        self._gains = np.array([one.feedback_gain for one in self.felt.settings])

    def desired(self, position: Array, velocity: Array, effort: Array) -> Array:
        return self.wanted.step(position[AXIS_SLICE], self._nothing)[0]

    def desired_by(self, reference: Array) -> Array:
        return self.wanted.step(reference, self._nothing)[0]

    def offset(self, position: Array) -> Array:
        return position[AXIS_SLICE] - self._neutral

    def offset_of(self, reference: Array) -> Array:
        return reference - self._neutral

    def torque(
        self, position: Array, velocity: Array, effort: Array, feedback: Array, damping: Array
    ) -> Array:
        _, felt = self.felt.step(position[AXIS_SLICE], feedback)
        self.saturated = _SATURATED in self.felt.results.tolist()
        np.add(felt, damping, out=self._effort_axes)
        np.clip(self._effort_axes, -OMNI_PEAK_TORQUE, OMNI_PEAK_TORQUE, out=self._effort_axes)
        return self._effort

    def at_hand(self, velocity: Array, effort: Array, given: Array) -> tuple[Array, Array]:
        return given[AXIS_SLICE], velocity[AXIS_SLICE]

    @property
    def feedback_gains(self) -> Array:
        return self._gains

    def reset(self) -> None:
        self.wanted.reset()
        self.felt.reset()

    def update(self, values: Values) -> None:
        self.wanted.update(values, AXES)
        self.felt.update(values, AXES)
        self._take()


class SfjMaster:
    """Scenario 2: the deflection of the joints is the hand's torque; feedback moves the drives."""

    def __init__(self, values: Values, master_dt: float, slave_dt: float) -> None:
        self.side = SfjMasterSide.from_parameters(values, STAGES, master_dt)
        self.saturated = False
        self._take()

    def _take(self) -> None:
        settings = self.side.settings
        self._neutral = np.array([one.neutral for one in settings])
        self._gains = np.array([one.feedback_gain for one in settings])
        self._stiffness = np.array([one.stiffness for one in settings])

    def desired(self, position: Array, velocity: Array, effort: Array) -> Array:
        return self.side.desired(effort[ARM_SLICE])

    def desired_by(self, reference: Array) -> Array:
        return self.side.desired(-reference)

    def offset(self, position: Array) -> Array:
        drive, deflection = position[MOTOR_SLICE] - self._neutral, position[ARM_SLICE] - position[MOTOR_SLICE]
        return np.where(np.abs(drive) > np.abs(deflection), drive, deflection)

    def offset_of(self, reference: Array) -> Array:
        return reference / self._stiffness

    def torque(
        self, position: Array, velocity: Array, effort: Array, feedback: Array, damping: Array
    ) -> Array:
        # A torque on the hand is given by drawing the drive back; its opposite resists.
        current = self.side.step(position[MOTOR_SLICE], velocity[MOTOR_SLICE], feedback, -damping)
        self.saturated = _SATURATED in self.side.results.tolist()
        return current * self.side.torque_constant

    def at_hand(self, velocity: Array, effort: Array, given: Array) -> tuple[Array, Array]:
        return effort[ARM_SLICE], velocity[ARM_SLICE]

    @property
    def feedback_gains(self) -> Array:
        return self._gains

    def reset(self) -> None:
        self.side.reset()

    def update(self, values: Values) -> None:
        self.side.update(values, STAGES)
        self._take()


class SfjSlave:
    """Scenario 1: a force law drives the flexible joints, whose deflection is the environment's torque."""

    def __init__(self, law: ForceLaw) -> None:
        self.law = law
        self.saturated = self.refused = False
        self.environment_torque: Array = np.zeros(2)

    def step(self, desired: Array, position: Array, velocity: Array, effort: Array) -> Array:
        self.environment_torque = effort[ARM_SLICE]
        current = self.law.step(desired, position[MOTOR_SLICE], position[ARM_SLICE], velocity[MOTOR_SLICE])
        results = self.law.results.tolist()
        self.saturated, self.refused = _SATURATED in results, _REFUSED in results
        return current * self.law.torque_constant

    def observe(self, position: Array, velocity: Array, effort: Array) -> None:
        self.environment_torque = effort[ARM_SLICE]

    def velocity(self, velocity: Array) -> Array:
        return velocity[ARM_SLICE]

    def reset(self) -> None:
        self.law.reset()

    def update(self, values: Values) -> None:
        self.law.update(values, STAGES)


class OmniSlave:
    """Scenario 2: the Omni, whose environment torque is estimated."""

    def __init__(self, values: Values, dt: float) -> None:
        self.law = OmniSlaveLaw.from_parameters(values, AXES, dt)
        self.saturated = self.refused = False
        self.environment_torque: Array = self.law.environment_torque
        self._effort, self._nothing = np.zeros(3), np.zeros(2)

    def step(self, desired: Array, position: Array, velocity: Array, effort: Array) -> Array:
        self.law.enabled[:] = True
        torque = self.law.step(desired, position[AXIS_SLICE], velocity[AXIS_SLICE], effort[AXIS_SLICE])
        results = self.law.results.tolist()
        self.saturated, self.refused = _SATURATED in results, _REFUSED in results
        self._effort[AXIS_SLICE] = torque
        return self._effort

    def observe(self, position: Array, velocity: Array, effort: Array) -> None:
        self.law.enabled[:] = False
        self.law.step(self._nothing, position[AXIS_SLICE], velocity[AXIS_SLICE], effort[AXIS_SLICE])

    def velocity(self, velocity: Array) -> Array:
        return velocity[AXIS_SLICE]

    def reset(self) -> None:
        self.law.release()  # the observer has followed the axis and knows it

    def update(self, values: Values) -> None:
        self.law.update(values, AXES)
