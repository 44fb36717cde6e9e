"""Recordings of a pendulum and of two masses, integrated here step by step with friction that sticks: nothing
of the project takes part."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record

DT, FINE = 0.002, 40


@njit
def swing(torque, inertia, damping, coulomb, weight, offset, detent, swirl):
    """Angles (n,) of a pendulum with dry friction that sticks, at FINE steps a sample."""
    q, v, h = 0.0, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            drive = torque[k] - (damping + swirl * math.sin(3 * q)) * v - weight * math.sin(q) + offset
            drive -= detent * (q - 0.2) / 0.3 * math.exp(0.5 - 0.5 * ((q - 0.2) / 0.3) ** 2)
            if v == 0.0 and abs(drive) <= coulomb:
                continue
            before = v
            side = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, drive)
            v += h * (drive - side * coulomb) / inertia
            if before * v < 0.0:
                v = 0.0
            q += h * v
    return found


@njit
def bent_spring(torque, inertia, damping):
    """Angles (n,) of a mass on a spring to ground that is harder to one side."""
    q, v, h = 0.0, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            v += h * (torque[k] - damping * v - 4.0 * q - 20.0 * q**2 - 150.0 * q**3) / inertia
            q += h * v
    return found


@njit
def two_masses(torque, stiffness, motor, arm, coulomb):
    """Angles (n, 2) of two masses with a spring, dry friction on the second."""
    state, h = np.zeros(4), DT / FINE
    found = np.empty((len(torque), 2))
    for k in range(len(torque)):
        found[k, 0], found[k, 1] = state[0], state[1]
        for _ in range(FINE):
            spring = stiffness * (state[0] - state[1])
            state[2] += h * (torque[k] - motor[1] * state[2] - spring) / motor[0]
            drive, v = spring - arm[1] * state[3], state[3]
            if v != 0.0 or abs(drive) > coulomb:
                side = math.copysign(1.0, v) if v != 0.0 else math.copysign(1.0, drive)
                state[3] += h * (drive - side * coulomb) / arm[0]
                if v * state[3] < 0.0:
                    state[3] = 0.0
            state[0] += h * state[2]
            state[1] += h * state[3]
    return found


def drive(seed: int, size: float, seconds: float = 20.0) -> np.ndarray:
    """A sum of sines below 2 Hz, N·m."""
    luck, t = np.random.default_rng(seed), DT * np.arange(round(seconds / DT))
    waves = [np.sin(2 * np.pi * f * t + luck.uniform(0, 6.3)) for f in luck.uniform(0.1, 2.0, 8)]
    return size * np.sum(waves, axis=0) / math.sqrt(8)


def record(torque: np.ndarray, angles: np.ndarray, step: float = 1e-4) -> Record:
    measured = np.full((len(torque), 2), np.nan)
    measured[:, : angles.shape[1]] = step * np.round(angles / step)
    return Record("made here", DT, torque, measured, np.zeros(len(torque)), (step, step))


def pendulum(seed: int, **more: float) -> Record:
    parts = {"coulomb": 0.0, "weight": 0.0, "offset": 0.0, "detent": 0.0, "swirl": 0.0} | more
    torque = drive(seed, 2.0 + 0.5 * seed)
    own = tuple(parts[n] for n in ("coulomb", "weight", "offset", "detent", "swirl"))
    return record(torque, swing(torque, 0.14, 0.35, *own)[:, None], 1e-5)


RIGID = Model(
    "generic",
    "j",
    "rigid_body",
    {"torque_constant": 1.0, "motor_inertia": 0.2, "motor_damping": 0.3},
    fixed=("torque_constant",),
)

ELASTIC = Model(
    "generic",
    "j",
    "flexible_joint",
    {
        "torque_constant": 1.0,
        "stiffness": 20.0,
        "motor_inertia": 0.06,
        "motor_damping": 0.3,
        "arm_inertia": 0.1,
        "arm_damping": 0.02,
    },
)
