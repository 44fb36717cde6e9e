"""How far an ideal observer could see a hidden effect: d' = sqrt(2 KL) after the lab has re-fitted its model.

The linear robot with its true noise (coloured torque on motor and arm, encoders with variance q²/12, white
current sense) has a steady-state Kalman filter; its whitened innovations are white when the model is true.
Everything that the six parameters do not hold enters them linearly: as a force on an equation, as an error of
an encoder, or as a difference of sensed and commanded current. The re-fit is linear too along the trajectory
that was driven: mass, damping and gain errors are forces -δJ a, -δb v, δK u. So

    d'² = min over β of || w(effect) - w(base columns) β ||²,

because two Gaussians of equal covariance have 2 KL = the squared whitened distance of their means. It assumes
that the noise is known and Gaussian: an upper bound of what any tool can see, and what sizes are drawn by.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.robots import SFJ_STAGES
from haptic_teleop_sysid.blind.robot import PERIOD, Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Whitener:
    """The filter of one robot: transition (6, 6), input of forces (6, 2), gain (6, 2), whitening (2, 2)."""

    transition: Array
    forces: Array
    gain: Array
    whitening: Array
    sense_noise: float


@dataclass(frozen=True)
class Driven:
    """An experiment as columns see it, all (n,): means over the sample that follows.

    motor, arm: angle at the sample; *_speed, *_acceleration: means; current: commanded, A.
    """

    motor: Array
    arm: Array
    motor_speed: Array
    arm_speed: Array
    motor_acceleration: Array
    arm_acceleration: Array
    current: Array
    other_acceleration: Array
    time: Array


@dataclass(frozen=True)
class Column:
    """What one explanation adds: forces (N·m), encoder errors (rad), sensed minus commanded current (A)."""

    motor_force: Array | float = 0.0
    arm_force: Array | float = 0.0
    motor_error: Array | float = 0.0
    arm_error: Array | float = 0.0
    current: Array | float = 0.0


COLUMNS = tuple(field.name for field in fields(Column))


def whitener(robot: Robot) -> Whitener:
    """Return the steady-state filter of the robot with its noise."""
    t = robot.truth
    dynamics = np.zeros((6, 6))
    dynamics[0, 2] = dynamics[1, 3] = 1.0
    dynamics[2, :4] = (
        np.array([-t["stiffness"], t["stiffness"], -t["motor_damping"], 0.0]) / t["motor_inertia"]
    )
    dynamics[3, :4] = np.array([t["stiffness"], -t["stiffness"], 0.0, -t["arm_damping"]]) / t["arm_inertia"]
    dynamics[2, 4], dynamics[3, 5] = 1.0 / t["motor_inertia"], 1.0 / t["arm_inertia"]
    dynamics[4, 4], dynamics[5, 5] = -1.0 / robot.colour_motor, -1.0 / robot.colour_arm
    entry = np.zeros((6, 2))
    entry[2, 0], entry[3, 1] = 1.0 / t["motor_inertia"], 1.0 / t["arm_inertia"]
    both = expm(np.block([[dynamics, entry], [np.zeros((2, 8))]]) * PERIOD)
    transition = np.asarray(both[:6, :6], dtype=np.float64)
    forces = np.asarray(both[:6, 6:], dtype=np.float64)
    drive = np.zeros((6, 6))
    for row, level, colour in (
        (4, robot.noise_motor, robot.colour_motor),
        (5, robot.noise_arm, robot.colour_arm),
    ):
        drive[row, row] = level**2 * (1.0 - math.exp(-2.0 * PERIOD / colour))
    look = np.eye(2, 6)
    facts = SFJ_STAGES[robot.stage]
    steps = np.array([facts.drive_resolution, facts.joint_resolution])
    # Angles in units of their encoder's step: otherwise the Riccati equation is badly scaled.
    scale = np.array([steps[0], steps[1], steps[0] / PERIOD, steps[1] / PERIOD, 1.0, 1.0])
    scale[4], scale[5] = max(robot.noise_motor, 1e-9), max(robot.noise_arm, 1e-9)
    a = transition * scale[None, :] / scale[:, None]
    q = drive / np.outer(scale, scale)
    r = np.eye(2) / 12.0
    covariance = solve_discrete_are(a.T, look.T, q + 1e-12 * np.eye(6), r)
    innovation = look @ covariance @ look.T + r
    gain = covariance @ look.T @ np.linalg.inv(innovation)
    whitening = np.linalg.inv(np.linalg.cholesky(innovation)) / steps[None, :]
    return Whitener(transition, forces, gain * scale[:, None] / steps[None, :], whitening, robot.sense_noise)


@njit(cache=True, fastmath=True)
def _respond(transition, forces, gain, whitening, inputs, which, start, out):
    """Write whitened innovations into out[:, 0] and out[:, 1], both (n, columns).

    inputs: (4, n, columns) force on motor and arm, error of both encoders; which: (4,) whether any is not
    zero.
    """
    n, columns = out.shape[1], out.shape[2]
    e, f = start.T.copy(), np.zeros((6, columns))
    for k in range(n):
        for c in range(columns):
            i0 = e[0, c]
            i1 = e[1, c]
            if which[2]:
                i0 += inputs[2, k, c]
            if which[3]:
                i1 += inputs[3, k, c]
            out[0, k, c] = whitening[0, 0] * i0
            out[1, k, c] = whitening[1, 0] * i0 + whitening[1, 1] * i1
            for i in range(6):
                f[i, c] = e[i, c] - gain[i, 0] * i0 - gain[i, 1] * i1
        for i in range(6):
            for c in range(columns):
                total = forces[i, 0] * inputs[0, k, c] + forces[i, 1] * inputs[1, k, c]
                total += transition[i, 0] * f[0, c] + transition[i, 1] * f[1, c] + transition[i, 2] * f[2, c]
                e[i, c] = (
                    total
                    + transition[i, 3] * f[3, c]
                    + transition[i, 4] * f[4, c]
                    + transition[i, 5] * f[5, c]
                )


def whiten(filter_: Whitener, columns: list[Column], n: int, start: Array | None = None) -> Array:
    """Return (3 n, columns): whitened innovations of both encoders, then the current sense over its noise."""
    inputs = np.zeros((4, n, len(columns)))
    out = np.zeros((3, n, len(columns)))
    for number, column in enumerate(columns):
        for row, values in enumerate(
            (column.motor_force, column.arm_force, column.motor_error, column.arm_error)
        ):
            if not isinstance(values, float):
                inputs[row, :, number] = values
        if not isinstance(column.current, float):
            out[2, :, number] = column.current / filter_.sense_noise
    which = np.array([bool(inputs[row].any()) for row in range(4)])
    first = np.zeros((len(columns), 6)) if start is None else start
    _respond(filter_.transition, filter_.forces, filter_.gain, filter_.whitening, inputs, which, first, out)
    return out.reshape(3 * n, len(columns))


def base_columns(filter_: Whitener, driven: Driven, known_torque_constant: bool) -> Array:
    """Return (3 n, k), orthonormal: all that the re-fit and the initial state can take up."""
    columns = [
        Column(motor_force=driven.motor_acceleration),
        Column(motor_force=driven.motor_speed),
        Column(arm_force=driven.arm_acceleration),
        Column(arm_force=driven.arm_speed),
    ]
    if not known_torque_constant:
        columns.append(Column(motor_force=driven.current))
    n = len(driven.motor)
    state = np.zeros((4, 6))
    # A sideways displacement of all is invisible, so displacement, deflection and the two speeds.
    state[0, :2], state[1, 1], state[2, 2], state[3, 3] = 1.0, 1.0, 1.0, 1.0
    start = np.vstack([np.zeros((len(columns), 6)), state])
    found = whiten(filter_, [*columns, *[Column()] * 4], n, start)
    # Some transients are nearly alike: what they do not differ in is kept once.
    left, values, _ = np.linalg.svd(_gram(found / np.linalg.norm(found, axis=0)))
    kept = values > 1e-11 * values[0]
    basis = (found / np.linalg.norm(found, axis=0)) @ (left[:, kept] / np.sqrt(values[kept]))
    # Once more, because the Gram matrix squared the condition.
    left, values, _ = np.linalg.svd(_gram(basis))
    return basis @ (left / np.sqrt(values))


def _gram(columns: Array) -> Array:
    return columns.T @ columns


def beyond(base: Array, columns: Array) -> Array:
    """Return the part of `columns` that `base`, orthonormal, cannot take up."""
    return columns - base @ (base.T @ columns)


def detectability(filter_: Whitener, driven: Driven, effect: Column, known_torque_constant: bool) -> float:
    """Return d' of `effect` in this experiment."""
    base = base_columns(filter_, driven, known_torque_constant)
    return float(np.linalg.norm(beyond(base, whiten(filter_, [effect], len(driven.motor)))))
