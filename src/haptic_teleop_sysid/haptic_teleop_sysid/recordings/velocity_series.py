"""The robots' velocity filter over a whole series of positions at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.filters import velocity_coefficients, velocity_step

Array = NDArray[np.float64]


def velocity_series(
    position: Array, dt: float, cutoff_hz: float, damping: float, velocity: float | None = None
) -> Array:
    """Velocities (n,) or (n, k), rad/s, that the filter makes of positions (n,) or (n, k), rad, every `dt` s.

    The motion before the first sample had `velocity`; None: it rested at the first position. NaN where the
    position is not finite.
    """
    rate = 0.0 if velocity is None else velocity
    columns = np.ascontiguousarray(position.reshape(len(position), -1))
    before = np.nan_to_num(columns[0] - dt * rate)
    # As the filter's own `reset`: a motion that has always been steady.
    lag = damping / (np.pi * cutoff_hz)
    state = np.column_stack([before - lag * rate, np.full_like(before, rate), before])
    return _series(columns, state, velocity_coefficients(dt, cutoff_hz, damping)).reshape(position.shape)


@njit(cache=True)
def _series(position: Array, state: Array, coefficients: Array) -> Array:
    out = np.empty(position.shape)
    for i in range(len(position)):
        velocity = velocity_step(position[i], state, coefficients)
        for j in range(len(velocity)):  # one by one: see `compiled.py`
            out[i, j] = velocity[j]
    return out
