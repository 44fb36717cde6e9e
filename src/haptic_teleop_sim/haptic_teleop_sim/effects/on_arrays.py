"""The helpers that effects' equations may use (`symbols.py`), on arrays: for following an equation along a
recorded motion."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: Bytes left for arguments and results that are remembered, of all functions together; those of a function
#: that is gone are free again.
_ROOM = [256_000_000]

NUMERIC: dict[str, Any] = {
    "side": lambda x: np.where(np.asarray(x) >= 0.0, 1.0, -1.0),
    "positive_part": lambda x: np.maximum(x, 0.0),
    "dead_band": lambda x, width: np.maximum(x - width / 2, 0.0) + np.minimum(x + width / 2, 0.0),
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "tanh": np.tanh,
    "sech": lambda x: 1.0 / np.cosh(np.clip(x, -300.0, 300.0)),
    "abs": np.abs,
    "sqrt": np.sqrt,
    "pi": math.pi,
}
"""Helpers on arrays, by the name that equations call them."""


def remembering(function: Callable[[FloatArray], FloatArray]) -> Callable[[FloatArray], FloatArray]:
    """A function of one array that is computed once for each argument: ripples of one order along one motion
    are asked for by several effects, and a sine takes twenty times as long as a comparison.

    What it returns is shared and cannot be written to; an argument must stay as it is."""
    known: dict[tuple[float, ...], list[tuple[FloatArray, FloatArray]]] = {}
    kept = [0]

    def remembered(x: FloatArray) -> FloatArray:
        if np.ndim(x) != 1 or not len(x):
            return function(x)
        alike = known.setdefault((len(x), *x[:: len(x) // 5 + 1].tolist(), float(x[-1])), [])
        for argument, result in alike:
            if np.array_equal(argument, x):
                return result
        found = function(x)
        size = x.nbytes + found.nbytes
        if size < _ROOM[0]:
            _ROOM[0] -= size
            kept[0] += size
            found.flags.writeable = False
            alike.append((x, found))
        return found

    weakref.finalize(remembered, _freed, kept)
    return remembered


def _freed(kept: list[int]) -> None:
    _ROOM[0] += kept[0]
