"""A log that is written more often than its encoder is read: the readings between repeat the last one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Samples from one reading to the next at most: with a sample of jitter what a record is not cut apart at
#: (`records.LONGEST_HOLE`).
MOST = 4
#: New values from which on their spacing says anything.
FEWEST = 50
#: Share of the spacings that must be the usual one, but for a sample of jitter.
REGULAR = 0.9
#: Spacings, in usual ones, from which on the joint rests and its readings repeat by themselves.
RESTS = 3.0
#: Difference between sizes of steps, relative to the usual one, that only a motion read at even times has;
#: and how many of these are asked for.
FINER, _FEW = 0.25, 5
#: Rounding of a log in single precision, relative to the largest value, four times.
_ROUNDED = 4.0 * float(np.finfo(np.float32).eps)


def seldom_read(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """True (n,) at the repeats of a position (n,) that is read once in two samples or more, evenly, up to
    MOST."""
    found = np.zeros(len(values), dtype=np.bool_)
    steps = np.diff(values)
    new = np.flatnonzero(np.isfinite(steps) & (steps != 0.0)) + 1
    if len(new) < FEWEST:
        return found
    apart = np.diff(new)
    usual = int(np.median(apart))
    moving = np.flatnonzero(apart < RESTS * usual)
    if not 2 <= usual <= MOST or np.mean(np.abs(apart[moving] - usual) <= 1) < REGULAR:
        return found
    sizes = np.abs(steps[new - 1])
    # Of an encoder that shows single steps the sizes are one or two of these, and nothing between.
    usual_size = float(np.median(sizes))
    between = np.diff(np.unique(sizes)) / usual_size
    least = max(_ROUNDED * float(np.nanmax(np.abs(values))) / usual_size, 1e-6)
    if np.count_nonzero((between > least) & (between < FINER)) < _FEW:
        return found
    for i in moving:
        # One that is as it was before was read as well, where the joint turns.
        since = np.arange(new[i] + 1, new[i + 1]) - new[i]
        found[new[i] + since] = (since % usual != 0) | (apart[i] < 1.5 * usual)
    return found
