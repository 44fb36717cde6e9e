"""The robots' velocity filter over a whole series of positions at once."""

from __future__ import annotations

import math
from collections.abc import Sequence

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
    columns = np.ascontiguousarray(position.reshape(len(position), -1))
    out = np.empty(columns.shape)
    begin = np.full((1, columns.shape[1]), 0.0 if velocity is None else velocity)
    _filter(columns, begin, dt, cutoff_hz, damping, np.array([[0, len(columns)]]), out)
    return out.reshape(position.shape)


def velocity_over(
    position: Array,
    dt: float,
    cutoff_hz: float,
    damping: float,
    spans: Sequence[tuple[int, int]],
    velocity: Array,
) -> Array:
    """The same of a position (n,) over each of ``spans`` alone, NaN outside; the motion before each had the
    ``velocity`` (n,) of its first sample."""
    out = np.full(len(position), np.nan)
    over = np.array(spans, dtype=np.int64).reshape(-1, 2)
    column = np.ascontiguousarray(position).reshape(-1, 1)
    _filter(column, velocity[over[:, :1]], dt, cutoff_hz, damping, over, out.reshape(-1, 1))
    return out


@njit(cache=True)
def _filter(
    position: Array, begin: Array, dt: float, cutoff_hz: float, damping: float, spans: Array, out: Array
) -> None:
    """Velocities of the positions (n, k) over each of ``spans`` into ``out`` (n, k); ``begin``
    (spans, k): rate of the motion before each."""
    coefficients = velocity_coefficients(dt, cutoff_hz, damping)
    # As the filter's own `reset`: a motion that has always been steady.
    lag = damping / (math.pi * cutoff_hz)
    state = np.empty((position.shape[1], 3))
    for w in range(spans.shape[0]):
        first = spans[w, 0]
        for j in range(state.shape[0]):
            rate = begin[w, j]
            before = position[first, j] - dt * rate
            if not math.isfinite(before):
                before = 0.0
            state[j, 0], state[j, 1], state[j, 2] = before - lag * rate, rate, before
        for i in range(first, spans[w, 1]):
            velocity = velocity_step(position[i], state, coefficients)
            for j in range(velocity.shape[0]):  # one by one: see `compiled.py`
                out[i, j] = velocity[j]
