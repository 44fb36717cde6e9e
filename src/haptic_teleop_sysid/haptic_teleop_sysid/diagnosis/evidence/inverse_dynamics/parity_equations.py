"""The equations of motion of a flexible joint, each without what acts at one place (see `parity`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arm_response import ArmResponse

FloatArray = NDArray[np.float64]

MOTOR, ARM, JOINT, ARM_ENCODER, MOTOR_ENCODER = "motor", "arm", "joint", "arm_encoder", "motor_encoder"
ENCODERS = (MOTOR_ENCODER, ARM_ENCODER)
_ALL = slice(None)


@dataclass(frozen=True)
class Rows:
    """One equation of one recording: what it has to equal, (n,); columns (n, p) of inertias, dampings and a
    stiffness, with their ``bounds``; and columns of what may have any sign."""

    target: FloatArray
    structure: FloatArray
    bounds: tuple[tuple[float, float], ...]
    free: FloatArray

    def at(self, kept: NDArray[np.intp]) -> Rows:
        """The same of some of its samples."""
        return replace(self, target=self.target[kept], structure=self.structure[kept], free=self.free[kept])

    def seen(self, arm: ArmResponse) -> Rows:
        """Both sides as the arm follows them."""
        free = np.column_stack([arm.each(self.free), arm.by_itself(len(self.target))])
        return Rows(arm(self.target), arm.each(self.structure), self.bounds, free)


@dataclass(frozen=True)
class Signals:
    """One recording in the band, (n,) or (n, motor and arm): torque of the input, motion, and ``known``
    torques (n, columns) by place; ``stiffness``: lowest and highest; ``kept``: samples that count; ``dt``:
    s."""

    torque: FloatArray
    angle: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    known: dict[str, FloatArray]
    stiffness: tuple[float, float]
    kept: NDArray[np.intp]
    dt: float

    def rows(self, target: FloatArray, inertial: Sequence[int], *free: FloatArray, kept: Any = _ALL) -> Rows:
        """An equation with inertias and dampings of some equations; an encoder's offset adds a constant.
        ``target`` and ``free`` hold the samples that are ``kept``."""
        columns = [a[kept, i] for i in inertial for a in (self.acceleration, self.velocity)]
        constant = np.ones(len(target))
        positive = ((0.0, np.inf),) * len(columns)
        return Rows(target, np.column_stack(columns), positive, np.column_stack([constant, *free]))

    def with_spring(self, rows: Rows, deflection: FloatArray) -> Rows:
        """The equation with the torque of a spring on its right side."""
        columns = np.column_stack([rows.structure, deflection])
        return replace(rows, structure=columns, bounds=(*rows.bounds, self.stiffness))

    def without_motor(self, stiffness: float) -> Rows:
        """The arm's equation."""
        spring = stiffness * (self.angle[:, 0] - self.angle[:, 1])
        return self.rows(spring, [1], self.known[ARM], self.known[JOINT])

    def without_arm(self) -> Rows:
        """The motor's equation."""
        rows = self.rows(self.torque, [0], self.known[MOTOR], self.known[JOINT])
        return self.with_spring(rows, self.angle[:, 0] - self.angle[:, 1])

    def without_joint(self) -> Rows:
        """The sum of both, in which no spring is."""
        return self.rows(self.torque, [0, 1], self.known[MOTOR], self.known[ARM])

    def without_arm_encoder(self, arm: ArmResponse, kept: Any = _ALL) -> Rows:
        """At the samples ``kept``: the motor's equation with the arm where its own equation has it, q_a = H
        (q_m + T / k) with T a known torque at the arm: K u = J_m a_m + b_m v_m + k (q_m - H q_m) - H T."""
        known = [arm.each(self.known[ARM]), self.known[JOINT] - arm.each(self.known[JOINT])]
        free = [self.known[MOTOR], *known, arm.by_itself(len(self.torque))]
        rows = self.rows(self.torque[kept], [0], *(one[kept] for one in free), kept=kept)
        return self.with_spring(rows, (self.angle[:, 0] - arm(self.angle[:, 0]))[kept])

    def without_motor_encoder(self, arm: ArmResponse, kept: Any = _ALL) -> Rows:
        """The same with the motor where the arm's equation has it, q_a = H q_m, both sides as the arm
        follows them, so that nothing is differentiated more often: H K u = J_m a_a + b_m v_a + J_a H (a_a +
        d v_a). A known torque behind the motor is there as the arm follows it, and with its derivatives."""
        free = [arm.each(self.known[MOTOR]), arm.by_itself(len(self.torque))]
        if self.known[ARM].shape[1] + self.known[JOINT].shape[1]:
            behind = arm.each(np.hstack([self.known[ARM], self.known[JOINT]]))
            rates = np.gradient(behind, self.dt, axis=0)
            free += [behind, rates, np.gradient(rates, self.dt, axis=0)]
        rows = self.rows(arm(self.torque)[kept], [1], *(one[kept] for one in free), kept=kept)
        reaction = arm(self.acceleration[:, 1] + arm.damping * self.velocity[:, 1])[kept]
        columns = np.column_stack([rows.structure, reaction])
        return replace(rows, structure=columns, bounds=(*rows.bounds, (0.0, np.inf)))
