"""Encoders that lose counts or slip on their shaft: from one sample to the next a reading is somewhere else,
and goes on from there as if nothing had happened."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LEAP = 8.0
"""Factor over the usual departures from a straight way (two samples ahead) that no motion makes ..."""
USUAL = 0.98
"""... which is the largest of this share of all that are not zero."""
AROUND = 12
"""Samples before and behind from which the way on either side is drawn."""
LONGEST_HOLD = 50
"""Samples for which a reading may be held before it catches up, instead of a slip."""
ALIKE = 0.3
"""Share by which a way drawn from either side may miss the size of a slip."""
UNEVEN = 0.2
"""Share of the sampling period by which stamps may be off for a jump to be one."""
SLOWEST = 0.006
"""s between samples in which no joint gets elsewhere and rests again."""
MOST = 20
"""Slips beyond which something else is wrong."""


@dataclass(frozen=True)
class Slip:
    """Reading `index` is the first that is off, by `size`, rad; `encoder`: of which joint, or its place;
    `time`: s, when."""

    index: int
    size: float
    encoder: str = ""
    time: float = 0.0


def slips(values: Array, time: Array, apart: NDArray[np.bool_] | None = None) -> list[Slip]:
    """Where a position (n,), all finite, moves elsewhere from one sample to the next and goes on with the
    speed that it had; ``time`` (n,), s.  A stop changes the speed at once but not the place, a held reading
    returns to its way, an outlier comes back.  Nothing is told beside lost samples, where ``apart`` (n,) says
    that a sample did not follow the one before, or where samples are so far apart (SLOWEST) that a joint may
    have moved."""
    steps = np.diff(time)
    if len(values) < 100 or np.median(steps) > SLOWEST:
        return []
    bend = np.diff(values, 2)  # bend[k] belongs to sample k + 1: what jumps at i bends by J and -J from i - 2
    usual = np.abs(bend[np.abs(bend) > 1e-12])
    if len(usual) < 100:
        return []
    limit = LEAP * float(np.quantile(usual, USUAL))
    uneven = np.abs(steps - np.median(steps)) > UNEVEN * np.median(steps)
    if apart is not None:
        uneven |= apart[1:]
    found = []
    for k in np.flatnonzero(np.abs(bend[:-1]) > limit):
        i, size = int(k) + 2, float(bend[k] - bend[k + 1]) / 2.0
        if abs(bend[k] + bend[k + 1]) > ALIKE * abs(size) or uneven[max(i - 3, 0) : i + 2].any():
            continue
        held = i - 1
        while held > 0 and i - held < LONGEST_HOLD and values[held - 1] == values[i - 1]:
            held -= 1
        first = max(held - AROUND, 0)
        before, behind = values[first : held + 1], values[i : i + AROUND]
        if min(len(before), len(behind)) < AROUND // 2 or i - held >= LONGEST_HOLD:
            continue
        # Where the way from before leads to, and the way behind comes from, halfway over what was held.
        middle = 0.5 * (time[held] + time[i - 1])
        speed = np.polyfit(time[first : held + 1], before, 1)[0]
        if held < i - 1 and abs(speed) * (time[i] - time[held]) > ALIKE * abs(size):
            continue  # the joint moved on while its reading was held
        degree = 2 if held == i - 1 else 1
        there = _drawn(time[first : held + 1] - middle, before, degree)
        here = _drawn(time[i : i + AROUND] - middle, behind, degree)
        if abs((here - there) - size) < ALIKE * abs(size):
            found.append(Slip(i, here - there if i - 1 > held else size))
    return found


def _drawn(time: Array, values: Array, degree: int) -> float:
    """A polynomial through (m,) values over (m,) time, read at time zero, which may lie beside them."""
    return float(np.polyfit(time, values, degree)[-1])


def excursions(found: list[Slip]) -> tuple[list[tuple[int, int]], list[Slip]]:
    """Stretches [start, stop) of samples that are elsewhere and come back within LONGEST_HOLD, which are no
    slips but outliers, and the slips that remain."""
    away, left = [], list(found)
    i = 0
    while i < len(left) - 1:
        one, other = left[i], left[i + 1]
        if other.index - one.index <= LONGEST_HOLD and (
            abs(one.size + other.size) < ALIKE * min(abs(one.size), abs(other.size))
        ):
            away.append((one.index, other.index))
            del left[i : i + 2]
        else:
            i += 1
    return away, left


def put_back(values: Array, found: list[Slip]) -> Array:
    """The position (n,) without its slips."""
    mended = values.copy()
    for slip in found:
        mended[slip.index :] -= slip.size
    return mended
