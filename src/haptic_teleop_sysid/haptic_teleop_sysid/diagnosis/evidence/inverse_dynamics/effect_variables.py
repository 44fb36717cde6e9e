"""The quantities along a motion that the equations of effects are written in."""

from __future__ import annotations

import math
from copy import copy
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sim.effects.on_arrays import NUMERIC

from .motion import BandedMotion

FloatArray = NDArray[np.float64]

#: Share of the top speed within which the sign of a velocity is smoothed.
SMOOTHED = 0.02


def variables_of(motion: BandedMotion, place: str, gives: float) -> SimpleNamespace:
    """What equations are written in but what the model says, as arrays (n,) along the motion."""
    if gives > 0.0:  # hardly asked for twice
        return _along(motion, place, gives)
    if place not in motion.known:
        motion.known[place] = _along(motion, place, gives)
    return copy(motion.known[place])


def _along(motion: BandedMotion, place: str, gives: float) -> SimpleNamespace:
    deflection = motion.angle[:, 0] - motion.angle[:, 1]
    if place == "joint":
        position, velocity = deflection, motion.velocity[:, 0] - motion.velocity[:, 1]
        acceleration = motion.acceleration[:, 0] - motion.acceleration[:, 1]
    else:
        channel = int(place == "arm")
        position, velocity = motion.angle[:, channel], motion.velocity[:, channel]
        acceleration = motion.acceleration[:, channel]
    # Each in one piece of memory: functions of arrays that are not take several times as long.
    position, velocity, acceleration = map(np.ascontiguousarray, (position, velocity, acceleration))
    if gives > 0.0:
        direction = turning(position, gives)
    else:
        direction = np.tanh(velocity / (SMOOTHED * max(float(np.max(np.abs(velocity))), 1e-12)))
    return SimpleNamespace(
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        deflection=deflection,
        deflection_rate=motion.velocity[:, 0] - motion.velocity[:, 1],
        time=motion.time,
        exogenous=motion.exogenous,
        direction=direction,
        **NUMERIC,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def turning(position: FloatArray, gives: float) -> FloatArray:
    """Memory of the direction (n,) between -1 and 1, d direction = (dq - |dq| direction) / gives, exact for a
    motion that does not turn between samples (Dahl 1968)."""
    direction = np.zeros(len(position))
    for k in range(1, len(position)):
        move = position[k] - position[k - 1]
        end = 1.0 if move > 0.0 else -1.0
        direction[k] = end + (direction[k - 1] - end) * math.exp(-abs(move) / gives)
    return direction
