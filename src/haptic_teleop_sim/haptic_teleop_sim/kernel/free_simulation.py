"""Free simulation of a model over many windows of a recording."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.filters import velocity_coefficients

from .build import free_runs
from .pack import Packed
from .predict import INITIAL, zero_sensitivities
from .simulate import Readings, readings, series_or_zeros

FloatArray = NDArray[np.float64]
Spans = Sequence[tuple[int, int]]
ENOUGH = 1e-4
"""Relative gain of the sum of squares that is not worth another response."""
MOST_TRIALS = 30
LONGEST = 1_000_000
"""Samples of a window by which its start is sought: each takes up to 340 bytes."""


def nearest_starts(
    packed: Packed,
    torque: ArrayLike,
    angles: FloatArray,
    dt: float,
    spans: Spans,
    begin: FloatArray,
    *,
    weights: FloatArray,
    rate_weights: FloatArray,
    velocity_filter: tuple[float, float] | None = None,
    exogenous: FloatArray | None = None,
    t0: float = 0.0,
) -> FloatArray:
    """Return (windows, 4): angles and velocities of motor and arm from which the free response over each of
    ``spans`` comes nearest to the measured ``angles`` (n, 2), rad, NaN where missing.

    ``packed``: mechanics alone; ``torque`` (n,): what acts on the motor, N·m; ``begin`` (windows, 4): from
    where to search, and what is returned where the response does not stay finite. Minimised is the sum of
    squares of the errors of both angles times ``weights`` (2,), 1/rad, and of both rates times
    ``rate_weights`` (2,), s/rad, 0.0 for one that does not count, over the first LONGEST samples of a window.
    Rates are those of ``velocity_filter`` (cut-off in Hz, damping), by differences without one. Damped
    Gauss-Newton with the exact sensitivities of the response.
    """
    states = np.array(begin, dtype=np.float64)
    spans = [(start, min(stop, start + LONGEST)) for start, stop in spans]
    filtered = velocity_filter is not None
    coefficients = velocity_coefficients(dt, *velocity_filter) if velocity_filter else np.zeros((2, 4))
    both = (np.array(one, dtype=np.float64) for one in (weights, rate_weights))
    free_runs().nearest_starts(
        _numbers(spans),
        states,
        np.ascontiguousarray(angles, dtype=np.float64),
        np.ascontiguousarray(torque, dtype=np.float64),
        series_or_zeros(exogenous, len(angles)),
        t0,
        _mechanics(packed, dt),
        (*both, filtered, coefficients),
        ENOUGH,
        MOST_TRIALS,
        zero_sensitivities(packed.states, len(INITIAL)),
    )
    return states


def respond(
    packed: Packed,
    torque: ArrayLike,
    dt: float,
    spans: Spans,
    states: FloatArray,
    *,
    exogenous: FloatArray | None = None,
    t0: float = 0.0,
) -> Readings:
    """Return what the encoders read (n,) in the free response over each of ``spans`` from ``states``
    (windows, 4), NaN outside; sensor effects included. Arguments as those of `nearest_starts`."""
    acting = np.ascontiguousarray(torque, dtype=np.float64)
    out = np.full((len(acting), packed.states), np.nan)
    free_runs().respond(
        _numbers(spans),
        np.ascontiguousarray(states, dtype=np.float64),
        acting,
        series_or_zeros(exogenous, len(acting)),
        t0,
        _mechanics(packed, dt),
        out,
    )
    time = t0 + dt * np.arange(len(acting), dtype=np.float64)
    return readings_over(packed, time, out, spans)


def readings_over(packed: Packed, time: FloatArray, states: FloatArray, spans: Spans) -> Readings:
    """What the encoders read within each of ``spans``: a late one sees nothing of the window before."""
    if not packed.skew:
        return readings(packed, time, states)
    found = Readings(*(np.full(len(time), np.nan) for _ in range(4)))
    for start, stop in spans:
        part = readings(packed, time[start:stop], states[start:stop])
        for whole, values in zip(found, part, strict=True):
            whole[start:stop] = values
    return found


def _numbers(spans: Spans) -> NDArray[np.int64]:
    return np.array(spans, dtype=np.int64).reshape(-1, 2)


def _mechanics(packed: Packed, dt: float) -> tuple:
    """See `free_runs.py`."""
    moved, lead = packed.encoder_shift(dt)
    follows = np.zeros(packed.states)
    follows[list(packed.velocity_states)] = 1.0
    return (
        dt,
        packed.substeps(dt),
        packed.rigid,
        packed.base,
        packed.codes,
        packed.p,
        packed.out_codes,
        lead,
        moved,
        follows,
    )
