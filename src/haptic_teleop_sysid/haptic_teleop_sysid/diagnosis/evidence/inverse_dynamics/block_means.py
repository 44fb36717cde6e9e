"""Fewer samples without what they cannot carry: means over four blocks, weighted by a cubic B-spline.

The spline is the box of one block with itself, three times more: its response sin(pi f d) / (d sin(pi f)),
to the fourth power (Hogenauer, IEEE Trans. ASSP 29(2), 1981), is all but zero where the blocks would fold
into the band, and what it takes within the band is known and given back by the filter that follows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit

FloatArray = NDArray[np.float64]

#: Boxes in a row.
ORDER = 4


def weights(block: int) -> FloatArray:
    """(ORDER (block - 1) + 1,) weights of the samples around one that is kept; their sum is 1."""
    box = np.full(block, 1.0 / block)
    found = box
    for _ in range(ORDER - 1):
        found = np.convolve(found, box)
    return found


def response(frequency: FloatArray, block: int) -> FloatArray:
    """What the means leave of a sine of ``frequency``, cycles per block, 0 to 0.5."""
    turned = np.pi * frequency
    below = block * np.sin(turned / block)
    return np.where(turned > 0.0, np.sin(turned) / np.where(turned > 0.0, below, 1.0), 1.0) ** ORDER


def block_means(values: FloatArray, block: int, first: int) -> FloatArray:
    """Means (m, columns) around the samples ``first``, ``first + block``, ... of ``values`` (n, columns),
    which go on beyond their ends as they are there."""
    return _means(np.ascontiguousarray(values, dtype=np.float64), weights(block), block, first)


def sparse_block_means(
    places: NDArray[np.intp], values: FloatArray, columns: int, block: int, first: int
) -> FloatArray:
    """`block_means` (m, ``columns``) of rows that are zero but for ``values`` (n, s), which stand in columns
    ``places`` (n, s)."""
    return _sparse_means(places, values, columns, weights(block), block, first)


@njit(cache=True, nogil=True, error_model="numpy")
def _means(values: FloatArray, weight: FloatArray, block: int, first: int) -> FloatArray:
    n, columns = values.shape
    width = len(weight)
    found = np.zeros(((n - first + block - 1) // block, columns))
    for m in range(len(found)):
        start = first + m * block - width // 2
        if start >= 0 and start + width <= n:  # apart from the ends: a fraction of the time
            for c in range(columns):
                total = 0.0
                for j in range(width):
                    total += weight[j] * values[start + j, c]
                found[m, c] = total
        else:
            for j in range(width):
                k = min(max(start + j, 0), n - 1)
                for c in range(columns):
                    found[m, c] += weight[j] * values[k, c]
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _sparse_means(
    places: NDArray[np.intp], values: FloatArray, columns: int, weight: FloatArray, block: int, first: int
) -> FloatArray:
    n, filled = values.shape
    reach = len(weight) // 2
    found = np.zeros(((n - first + block - 1) // block, columns))
    for m in range(len(found)):
        for j in range(len(weight)):
            k = min(max(first + m * block + j - reach, 0), n - 1)
            for s in range(filled):
                found[m, places[k, s]] += weight[j] * values[k, s]
    return found
