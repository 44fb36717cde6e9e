"""The helpers that effects' equations may use (`symbols.py`), on arrays: for following an equation along a
recorded motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.compiled import njit

FloatArray = NDArray[np.float64]

#: pi in three parts, so that a multiple of it up to LARGEST is subtracted without a rounding error (Cody and
#: Waite, Software Manual for the Elementary Functions, 1980).
_PI = (3.1415926218032836914, 3.1786509424591713469e-08, 1.2246467864107188502e-16)
_PER_PI = 1.0 / math.pi
#: Adding and subtracting it rounds to the nearest whole number: its last place is 1.
_WHOLE = 1.5 * 2.0**52
#: Coefficients of x^3 to x^21 of the sine: beyond, they are less than 2e-18 of it on a half turn.
_SERIES = tuple((-1.0) ** n / math.factorial(2 * n + 1) for n in range(1, 11))
#: Largest argument, rad.
LARGEST = 1e6


def sine(x: ArrayLike) -> Any:
    """The sine of each element of ``x``, rad, of its shape, to 3e-16; NumPy's own beyond LARGEST.

    Ripples of hundreds of orders are followed along each motion. A compiler makes vector instructions of
    this; those of the C library take ten times as long."""
    values = np.asarray(x, dtype=np.float64)
    if values.ndim == 0 or not np.max(np.abs(values), initial=0.0) <= LARGEST:
        return np.sin(values)
    return _sines(np.ascontiguousarray(values).ravel()).reshape(values.shape)


@njit(cache=True, nogil=True, error_model="numpy")
def _sines(x: FloatArray) -> FloatArray:
    """Half turns are taken off until half of one is left to either side; each turns the sign."""
    a, b, c, d, e, f, g, h, i, j = _SERIES
    found = np.empty_like(x)
    for n in range(x.size):
        turns = (x[n] * _PER_PI + _WHOLE) - _WHOLE
        half = 0.5 * turns
        sign = 1.0 - 4.0 * abs(half - ((half + _WHOLE) - _WHOLE))
        r = ((x[n] - turns * _PI[0]) - turns * _PI[1]) - turns * _PI[2]
        s = r * r
        high = ((((j * s + i) * s + h) * s + g) * s + f) * s + e
        found[n] = sign * (r + r * s * ((((high * s + d) * s + c) * s + b) * s + a))
    return found


NUMERIC: dict[str, Any] = {
    "side": lambda x: np.where(np.asarray(x) >= 0.0, 1.0, -1.0),
    "positive_part": lambda x: np.maximum(x, 0.0),
    "dead_band": lambda x, width: np.maximum(x - width / 2, 0.0) + np.minimum(x + width / 2, 0.0),
    "sin": sine,
    "cos": np.cos,
    "exp": np.exp,
    "tanh": np.tanh,
    "sech": lambda x: 1.0 / np.cosh(np.clip(x, -300.0, 300.0)),
    "abs": np.abs,
    "sqrt": np.sqrt,
    "pi": math.pi,
}
"""Helpers on arrays, by the name that equations call them."""
