"""Encoders of motor and arm that count from different zeros: told by a deflection that nothing could hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

Array = NDArray[np.float64]

SPREADS = 3.0
"""Standard deviations of the deflection that its mean must exceed."""


def arm_zero(
    motor: Array, arm: Array, input_: Array, valid: NDArray[np.bool_], dt: float, model: Model
) -> float:
    """What the arm's encoder reads (rad) where the motor's reads zero and the spring is at rest; 0.0 where
    both may well count from the same zero.

    Over a recording the motor's mean torque balances the spring's, K mean(u) - b mean(v) = k mean(q_m - q_a),
    but for dry friction, which is less than the largest torque where the motor moves.
    """
    known = valid & np.isfinite(motor) & np.isfinite(arm) & np.isfinite(input_)
    if model.rigid or np.count_nonzero(known) < 2:
        return 0.0
    stiffness = model.parameters["stiffness"]
    bend, torque = (motor - arm)[known], model.parameters["torque_constant"] * input_[known]
    first, *_, last = np.flatnonzero(known)
    velocity = float(motor[last] - motor[first]) / (dt * max(last - first, 1))
    mean, given = float(np.mean(bend)), float(np.mean(torque)) - model.parameters["motor_damping"] * velocity
    held = float(np.max(np.abs(torque)))
    if not abs(stiffness * mean - given) > held > 0.0 or abs(mean) < SPREADS * float(np.std(bend)):
        return 0.0
    return given / stiffness - mean


def told(zero: float, unit: str) -> str:
    """What to know of it."""
    return (
        f"motor and arm count from different zeros: {zero:.4g} {unit} was taken off the arm's angle, because "
        "the joint would otherwise be bent by more than the motor can hold"
    )
