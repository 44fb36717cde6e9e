"""A joint in a position loop, integrated here step by step, with more in it than anybody models: dry friction
that sticks, a torque that wanders over the angle, damping that grows with speed, random torque. Nothing of
the project takes part but the container of the recording."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from haptic_teleop_sysid.recordings.dataset import DataSet

DT, FINE, STEP = 0.002, 20, 2e-5
INERTIA, DAMPING, COULOMB = 0.2, 0.3, 0.3
PULL, BRAKE = 20.0, 2.5
RUMBLE, REMEMBERED = 0.003, 0.05


@njit
def _run(reference, noise, pushed, orders):
    angle, velocity, before, h = 0.0, 0.0, 0.0, DT / FINE
    read, torque = np.empty(len(reference)), np.empty(len(reference))
    for k in range(len(reference)):
        read[k] = angle + noise[k]
        torque[k] = PULL * (reference[k] - read[k]) - BRAKE * (read[k] - before) / DT
        before = read[k]
        for _ in range(FINE):
            drive = torque[k] + pushed[k] - DAMPING * velocity * (1.0 + 0.5 * math.tanh(abs(velocity)))
            for j in range(len(orders)):
                drive += 0.02 * math.sin(orders[j] * angle + j)
            if velocity == 0.0 and abs(drive) <= COULOMB:
                continue
            old, side = velocity, velocity if velocity != 0.0 else drive
            velocity += h * (drive - math.copysign(COULOMB, side)) / INERTIA
            if old * velocity < 0.0:
                velocity = 0.0
            angle += h * velocity
    return read, torque


def _rumbling(generator: np.random.Generator, count: int) -> np.ndarray:
    keep = math.exp(-DT / REMEMBERED)
    found, new = np.zeros(count), generator.standard_normal(count) * math.sqrt(1.0 - keep**2)
    for k in range(1, count):
        found[k] = keep * found[k - 1] + new[k]
    return RUMBLE * found


def looped(seed: int, late: int, size: float, seconds: float = 20.0) -> DataSet:
    """A recording of a motion of ``size``, rad, whose torque acts ``late`` samples after it is recorded."""
    generator, count = np.random.default_rng(seed), round(seconds / DT)
    time = DT * np.arange(count)
    tones = generator.uniform(0.05, 0.6, 5)
    waves = [np.sin(2.0 * np.pi * tone * time + generator.uniform(0.0, 6.3)) for tone in tones]
    noise = STEP * generator.standard_normal(count)
    orders = np.linspace(3.0, 70.0, 12)
    reference = size * np.sum(waves, axis=0) / math.sqrt(5.0)
    angle, torque = _run(reference, noise, _rumbling(generator, count), orders)
    angle = STEP * np.rint(angle / STEP)
    return DataSet(
        name=f"loop {seed}",
        robot="generic",
        joint="j",
        dt=DT,
        input=np.append(torque[late:], np.full(late, torque[-1])),
        input_unit="N*m",
        input_source="commanded effort",
        motor_position=angle,
        motor_velocity=np.gradient(angle, DT),
        valid=np.ones(count, dtype=np.bool_),
    )
