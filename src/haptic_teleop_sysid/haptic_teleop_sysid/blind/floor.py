"""The fit that the truth itself would reach: what random torque, quantisation and sense leave open.

Random torque moves the linear robot; a simulation of the truth misses that motion, but for what the estimated
initial state of each window takes up. Effects are left out of this response, so with strong friction the
floor is a little pessimistic.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.blind.planting import Setting, run
from haptic_teleop_sysid.blind.robot import PERIOD, Experiment

Array = NDArray[np.float64]
WINDOWS = (1.0, 2.0, 4.0, 8.0, None)
"""Lengths of the windows of a simulated fit, s; None is the whole recording."""


def floor_percent(
    setting: Setting,
    push: Array,
    measured: dict[str, Array],
    velocity: Callable[[Array], Array],
    rng: np.random.Generator,
) -> dict[str, dict[str, float]]:
    """Return {window: {signal: percent}}; `measured`: recorded velocities, motor first."""
    robot, n = setting.robot, setting.samples
    idle = replace(setting, experiment=Experiment("open loop current", "", np.zeros(n), np.zeros(8)))
    noisy = push.copy()
    noisy[:, 0] += robot.truth["torque_constant"] * robot.sense_noise * rng.standard_normal(n + 1)
    out = run(idle, [], None, noisy).out
    vector = robot.vector()
    missed = []
    for column, step in ((0, vector[7]), (1, vector[8])):
        rounding = step * (rng.random(n) - 0.5)
        missed.append(velocity(out[:, column] + rounding))
    free = _free_velocities(robot.truth, n, velocity)
    result: dict[str, dict[str, float]] = {}
    for window in WINDOWS:
        parts = 1 if window is None else max(1, round(n * PERIOD / window))
        borders = np.rint(np.linspace(0, n, parts + 1)).astype(int)
        left: list[list[Array]] = [[], []]
        for start, stop in pairwise(borders.tolist()):
            length = stop - start
            columns = np.concatenate([free[0][:length], free[1][:length]])
            wanted = np.concatenate([missed[0][start:stop], missed[1][start:stop]])
            scale = np.linalg.norm(columns, axis=0)
            rest = wanted - columns / scale @ np.linalg.lstsq(columns / scale, wanted, rcond=1e-9)[0]
            left[0].append(rest[:length])
            left[1].append(rest[length:])
        result["whole" if window is None else f"{window:g}"] = {
            name: 100.0
            * (1.0 - float(np.linalg.norm(np.concatenate(rest)) / np.linalg.norm(values - values.mean())))
            for (name, values), rest in zip(measured.items(), left, strict=True)
        }
    return result


def _free_velocities(
    truth: dict[str, float], n: int, velocity: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Return filtered speeds of motor and arm, (n, 4) each, released from unit deflection and unit speeds."""
    k, jm, ja = truth["stiffness"], truth["motor_inertia"], truth["arm_inertia"]
    dynamics = np.array(
        [
            [0, 0, 1, 0],
            [0, 0, 0, 1],
            [-k / jm, k / jm, -truth["motor_damping"] / jm, 0],
            [k / ja, -k / ja, 0, -truth["arm_damping"] / ja],
        ]
    )
    values, vectors = np.linalg.eig(dynamics)
    time = np.arange(n) * PERIOD
    modes = np.exp(np.outer(time, values))
    inverse = np.linalg.inv(vectors)
    motor, arm = [], []
    for state in np.eye(4)[1:]:  # moving both ends alike shows in no velocity
        path = np.real((modes * (inverse @ state)) @ vectors.T)
        motor.append(path[:, 2])
        arm.append(path[:, 3])
    return np.column_stack(motor), np.column_stack(arm)
