"""Innovations and their derivatives in units of their standard deviation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sim.kernel import Packed

from .likelihood import after_settling, channels, innovation_covariance, seen
from .records import Record

FloatArray = NDArray[np.float64]


def whitening_weight(spread: FloatArray) -> FloatArray:
    """W (k, k), upper triangular: e W has the unit covariance where the rows e (n, k) have ``spread`` (k, k).

    Raises np.linalg.LinAlgError where the covariance is not positive definite."""
    return np.asarray(np.linalg.inv(np.linalg.cholesky(spread)).T, dtype=np.float64)


def whiten(
    packed: Packed,
    record: Record,
    innovation: FloatArray,
    slope: FloatArray,
    reference: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Innovations (m,) and their derivatives (m, p) in units of their standard deviation (or that of
    ``reference`` (n, 2)), channels decorrelated; of the innovations (n, 2) and their derivatives (n, 2, p).
    Zero where a reading is missing, which has no score.
    """
    used = len(channels(packed, record))
    spread = innovation_covariance(packed, record, innovation if reference is None else reference)
    weight = whitening_weight(spread)
    e = after_settling(record, innovation)[:, :used] @ weight
    jacobian = _decorrelated(after_settling(record, slope), weight)
    there = after_settling(record, seen(packed, record))[:, :used]
    if not there.all():
        part = there.astype(np.float64)
        if used == 2:  # the arm's reading alone, in units of its own standard deviation
            part[there[:, 1] & ~there[:, 0], 1] = 1.0 / (weight[1, 1] * np.sqrt(spread[1, 1]))
        e, jacobian = e * part, jacobian * part.reshape(-1, 1)
    return e.reshape(-1), jacobian


@njit(cache=True, error_model="numpy", nogil=True)
def _decorrelated(slope: FloatArray, weight: FloatArray) -> FloatArray:
    """slope (n, 2, p) times the upper triangular weight (1, 1) or (2, 2), as (m, p); in one pass, where a
    product of stacks would go over the memory a dozen times."""
    n, _, p = slope.shape
    used = len(weight)
    found = np.empty((n * used, p))
    for k in range(n):
        for j in range(p):
            found[k * used, j] = slope[k, 0, j] * weight[0, 0]
        if used == 2:
            for j in range(p):
                found[2 * k + 1, j] = slope[k, 1, j] * weight[1, 1] + weight[0, 1] * slope[k, 0, j]
    return found
