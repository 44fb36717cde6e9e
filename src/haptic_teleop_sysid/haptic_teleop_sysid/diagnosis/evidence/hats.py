"""Hats: piecewise linear functions of a quantity that are 1 at one knot and 0 at all others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def hats(values: FloatArray, knots: FloatArray, held: bool = True) -> FloatArray:
    """Hats (n, knots) at values (n,); beyond the knots constant, or nothing unless they are ``held``."""
    left, share = between(values, knots)
    there = np.ones(len(values), dtype=np.bool_) if held else (values >= knots[0]) & (values <= knots[-1])
    rows = np.flatnonzero(there)
    found = np.zeros((len(values), len(knots)))
    found[rows, left[rows]], found[rows, left[rows] + 1] = 1.0 - share[rows], share[rows]
    return found


def hat(left: NDArray[np.intp], share: FloatArray, number: int) -> FloatArray:
    """The hat (n,) of one knot, from what `between` says."""
    return (left == number) * (1.0 - share) + (left + 1 == number) * share


def between(values: FloatArray, knots: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """Of each value (n,) the knot below it and the share of the way to the next one, 0 to 1: the two hats
    that are not zero there."""
    left = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    return left, np.clip((values - knots[left]) / (knots[left + 1] - knots[left]), 0.0, 1.0)
