"""Least squares of a few numbers within bounds, from products of columns: compiled, because a group search
asks for thousands of such solutions, each of less than ten numbers.

An active set (Lawson and Hanson, Solving Least Squares Problems, 1974, ch. 23; Stark and Parker,
Computational Statistics 10, 1995): numbers beyond their bounds are held there, and one is let go again when
the squares fall inwards from its bound. The products are positive definite by what is added to them, so there
is one solution, whichever way leads to it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit

FloatArray = NDArray[np.float64]

#: Added to the products of scaled columns, so that those which are alike share what they explain.
RIDGE = 1e-10
#: Times each number may be held or let go before the way counts as a circle.
_OFTEN = 10


@njit(cache=True, nogil=True, error_model="numpy")
def scale_of(products: FloatArray) -> FloatArray:
    """Lengths (p,) of columns from their products (p, p); 1 for a column of zeros."""
    scale = np.empty(len(products))
    for i in range(len(scale)):
        scale[i] = math.sqrt(products[i, i])
        if not scale[i] > 0.0:
            scale[i] = 1.0
    return scale


@njit(cache=True, nogil=True, error_model="numpy")
def _solve(a: FloatArray, b: FloatArray) -> None:
    """Solution (n,) of a x = b, into ``b``, by elimination with the largest pivot of each column; ``a``
    (n, n) is used up. For a few numbers, and compiled in a fraction of the time of the library's call."""
    n = len(b)
    for k in range(n):
        pivot = k
        for r in range(k + 1, n):
            if abs(a[r, k]) > abs(a[pivot, k]):
                pivot = r
        if pivot != k:
            b[k], b[pivot] = b[pivot], b[k]
            for c in range(k, n):
                a[k, c], a[pivot, c] = a[pivot, c], a[k, c]
        for r in range(k + 1, n):
            factor = a[r, k] / a[k, k]
            b[r] -= factor * b[k]
            for c in range(k + 1, n):
                a[r, c] -= factor * a[k, c]
    for k in range(n - 1, -1, -1):
        for c in range(k + 1, n):
            b[k] -= a[k, c] * b[c]
        b[k] /= a[k, k]


@njit(cache=True, nogil=True, error_model="numpy")
def within_bounds(
    products: FloatArray, mixed: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, bool]:
    """Least squares (p,) within bounds from products of columns (p, p) and with the target (p,), scaled, so
    that units do not matter, and the shortest where columns are alike; and whether the way there ended."""
    p = len(mixed)
    scale = scale_of(products)
    a, b = np.empty((p, p)), np.empty(p)
    for i in range(p):
        b[i] = mixed[i] / scale[i]
        for j in range(p):
            a[i, j] = products[i, j] / (scale[i] * scale[j])
        a[i, i] += RIDGE
    lowest, highest, found = np.empty(p), np.empty(p), np.empty(p)
    largest = 0.0
    for i in range(p):
        lowest[i], highest[i] = low[i] * scale[i], high[i] * scale[i]
        largest = max(largest, abs(b[i]))
    x = np.zeros(p)
    held = np.zeros(p, dtype=np.bool_)
    free = np.empty(p, dtype=np.int64)
    ended = False
    for _ in range(_OFTEN * p + 1):
        n = 0
        for i in range(p):
            if not held[i]:
                free[n] = i
                n += 1
        if n:
            part, right = np.empty((n, n)), np.empty(n)
            for r in range(n):
                right[r] = b[free[r]]
                for c in range(n):
                    part[r, c] = a[free[r], free[c]]
                for j in range(p):
                    if held[j]:
                        right[r] -= a[free[r], j] * x[j]
            _solve(part, right)
            beyond = False
            for r in range(n):
                i = free[r]
                x[i] = min(max(right[r], lowest[i]), highest[i])
                if x[i] != right[r]:
                    held[i] = True
                    beyond = True
            if beyond:
                continue
        # The one along which the squares fall most inwards from its bound.
        steepest, released = 1e-12 * largest, -1
        for i in range(p):
            if held[i]:
                down = b[i]
                for j in range(p):
                    down -= a[i, j] * x[j]
                inwards = down if x[i] <= lowest[i] else -down
                if lowest[i] < highest[i] and inwards > steepest:
                    steepest, released = inwards, i
        if released < 0:
            ended = True
            break
        held[released] = False
    for i in range(p):
        found[i] = x[i] / scale[i]
    return found, ended
