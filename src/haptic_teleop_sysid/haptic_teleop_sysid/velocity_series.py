"""The robots' velocity filter over a whole series of positions at once."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from haptic_teleop_control.filters import velocity_coefficients, velocity_step

Array = NDArray[np.float64]


def velocity_series(
    position: Array, dt: float, cutoff_hz: float, damping: float, velocity: float | None = None
) -> Array:
    """Velocities (n,), rad/s, that the filter makes of positions (n,), rad, every `dt` s.

    The motion before the first sample had `velocity`; None: it rested at the first position. NaN where the
    position is not finite.
    """
    rate = 0.0 if velocity is None else velocity
    before = float(np.nan_to_num(position[0] - dt * rate))
    # As the filter's own `reset`: a motion that has always been steady.
    lag = damping / (np.pi * cutoff_hz)
    state = np.array([[before - lag * rate, rate, before]])
    return _series(np.ascontiguousarray(position), state, velocity_coefficients(dt, cutoff_hz, damping))


@njit(cache=True)
def _series(position: Array, state: Array, coefficients: Array) -> Array:
    out = np.empty(len(position))
    for i in range(len(position)):
        out[i] = velocity_step(position[i : i + 1], state, coefficients)[0]
    return out
