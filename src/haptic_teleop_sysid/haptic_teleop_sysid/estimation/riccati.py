"""Matrix exponential and stationary Riccati equation for matrices of a few rows.

The library's routines check, balance and order eigenvalues, which takes a hundred times longer than the
arithmetic for 6 x 6 matrices, and the observer gain is wanted thousands of times in a diagnosis.  Tests
hold both against the library.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit

FloatArray = NDArray[np.float64]
_TERMS = 14


def exponential(a: FloatArray) -> FloatArray:
    """exp(a) (n, n) by scaling and squaring of the Taylor series, to rounding for any finite matrix of
    moderate norm."""
    norm = float(np.max(np.sum(np.abs(a), axis=1)))
    if not np.isfinite(norm):
        raise np.linalg.LinAlgError("the matrix is not finite")
    squarings = max(0, int(np.ceil(np.log2(norm / 0.25)))) if norm > 0.25 else 0
    return _exponential(np.ascontiguousarray(a, dtype=np.float64), squarings)


def stationary_filter(
    f: FloatArray, c: FloatArray, q: FloatArray, r: FloatArray, most: int = 60
) -> tuple[FloatArray, FloatArray]:
    """Covariance P (n, n) of the prediction error of a stationary Kalman filter, and its gain (n, m):

    P = F (P - P C' (C P C' + R)^-1 C P) F' + Q, by structured doubling (Chu, Fan and Lin 2005), which
    doubles the number of samples at every step; gain P C' (C P C' + R)^-1, which corrects the prediction.
    Raises LinAlgError when it does not settle (an unobservable drift).
    """
    f, c, q, r = (np.ascontiguousarray(matrix, dtype=np.float64) for matrix in (f, c, q, r))
    found, p, gain = _filter(f, c, q, r, most)
    if not found:
        raise np.linalg.LinAlgError(
            "the stationary Riccati equation has no solution for this model and these levels"
        )
    return p, gain


@njit(cache=True, error_model="numpy", nogil=True)
def _filter(
    f: FloatArray, c: FloatArray, q: FloatArray, r: FloatArray, most: int
) -> tuple[bool, FloatArray, FloatArray]:
    # r has two rows at most, so its inverse is as good as a solution, and is compiled for the gain anyway.
    ct = np.ascontiguousarray(c.T)
    found, p = _doubling(np.ascontiguousarray(f.T), ct @ np.linalg.inv(r) @ c, q.copy(), most)
    if not found:
        return False, p, ct
    shown = p @ ct
    return True, p, shown @ np.linalg.inv(c @ shown + r)


@njit(cache=True, error_model="numpy", nogil=True)
def _exponential(a: FloatArray, squarings: int) -> FloatArray:
    scaled = a / 2.0**squarings
    term = np.eye(len(a))
    total = term.copy()
    for k in range(1, _TERMS):
        term = term @ scaled / k
        total += term
    for _ in range(squarings):
        total = total @ total
    return total


@njit(cache=True, error_model="numpy", nogil=True)
def _doubling(a: FloatArray, g: FloatArray, h: FloatArray, most: int) -> tuple[bool, FloatArray]:
    identity = np.eye(len(a))
    for _ in range(most):
        w = np.linalg.inv(identity + g @ h)
        aw = a @ w
        step = np.ascontiguousarray(a.T) @ h @ w @ a
        g = g + aw @ g @ np.ascontiguousarray(a.T)
        a = aw @ a
        h = h + 0.5 * (step + step.T)
        if not np.all(np.isfinite(h)):
            break
        # Every state on its own scale: angles are some 1e-10, torques 1e-2.
        if np.all(np.abs(np.diag(step)) <= 1e-10 * np.abs(np.diag(h))):
            return True, h
    return False, h
