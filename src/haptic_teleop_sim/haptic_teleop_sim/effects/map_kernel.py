"""The compiled side of a measured torque: value and derivatives from the packed numbers of a `TorqueMap`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit

FloatArray = NDArray[np.float64]


@njit(cache=True, error_model="numpy", nogil=True)
def map_value(position, velocity, deflection, stiffness, time, exogenous, input, deflection_rate, state0,
              state1, direction, p, k):  # fmt: skip
    """Torque of the map at ``p[k:]`` (`TorqueMap.packed`), N·m."""
    both = p[k] > 1.5
    at = k + 5
    a0, a1, a2, a3, row = 0.0, 0.0, 0.0, 0.0, 0
    b0, b1, b2, b3, column = 1.0, 0.0, 0.0, 0.0, 0
    for axis in range(2 if both else 1):
        code = int(p[k + 1 + axis])
        if code < 2:
            x = position if code == 0 else velocity
        elif code < 4:
            x = deflection if code == 2 else deflection_rate
        else:
            x = input if code == 4 else exogenous
        n = int(p[k + 3 + axis])
        x = min(max(x, p[at]), p[at + n - 1])
        low, high = 0, n - 1
        while high - low > 1:
            middle = (low + high) // 2
            if p[at + middle] <= x:
                low = middle
            else:
                high = middle
        h = p[at + low + 1] - p[at + low]
        s = (x - p[at + low]) / h
        # Weights of the values and of the slopes at both ends.
        w0, w1 = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s), s * s * (3.0 - 2.0 * s)
        w2, w3 = h * s * (1.0 - s) * (1.0 - s), h * s * s * (s - 1.0)
        if axis == 0:
            a0, a1, a2, a3, row = w0, w1, w2, w3, low
        else:
            b0, b1, b2, b3, column = w0, w1, w2, w3, low
        at += n
    n = int(p[k + 3])
    if not both:
        o = at + row
        return a0 * p[o] + a1 * p[o + 1] + a2 * p[o + n] + a3 * p[o + n + 1]
    m = int(p[k + 4])
    size = n * m
    total = 0.0
    for i in range(2):
        o = at + (row + i) * m + column
        value, slope = (a0, a2) if i == 0 else (a1, a3)
        total += value * (b0 * p[o] + b1 * p[o + 1] + b2 * p[o + 2 * size] + b3 * p[o + 2 * size + 1])
        o += size
        total += slope * (b0 * p[o] + b1 * p[o + 1] + b2 * p[o + 2 * size] + b3 * p[o + 2 * size + 1])
    return total


#: Width of the difference by which derivatives are taken, as a share of the span of the knots: the map is a
#: cubic between them, so that a central difference is exact to its square.
_NEAR = 1e-6


@njit(cache=True, error_model="numpy", nogil=True)
def map_value_derivatives(position, velocity, deflection, stiffness, time, exogenous, input, deflection_rate,
                          state0, state1, direction, p, k, g):  # fmt: skip
    """The same with its derivatives by what it depends on (`codegen.DERIVATIVE_ORDER`)."""
    for i in range(9):
        g[i] = 0.0
    at = k + 5
    for axis in range(int(p[k])):
        code = int(p[k + 1 + axis])
        n = int(p[k + 3 + axis])
        h = _NEAR * (p[at + n - 1] - p[at])
        at += n
        if code > 4:
            continue
        q, v = (h if code == 0 else 0.0), (h if code == 1 else 0.0)
        d, r, u = (h if code == 2 else 0.0), (h if code == 3 else 0.0), (h if code == 4 else 0.0)
        above = map_value(position + q, velocity + v, deflection + d, stiffness, time, exogenous, input + u,
                          deflection_rate + r, state0, state1, direction, p, k)  # fmt: skip
        below = map_value(position - q, velocity - v, deflection - d, stiffness, time, exogenous, input - u,
                          deflection_rate - r, state0, state1, direction, p, k)  # fmt: skip
        place = 0 if code == 0 else (1 if code == 1 else (2 if code == 2 else (8 if code == 3 else 7)))
        g[place] = (above - below) / (2.0 * h)
    return map_value(position, velocity, deflection, stiffness, time, exogenous, input, deflection_rate,
                     state0, state1, direction, p, k)  # fmt: skip


@njit(cache=True, error_model="numpy", nogil=True)
def map_series(first: FloatArray, second: FloatArray, p: FloatArray) -> FloatArray:
    """The map along values (n,) of its variables, whatever they are called."""
    q = p.copy()
    q[1], q[2] = 0.0, 1.0
    found = np.empty(len(first))
    for i in range(len(first)):
        found[i] = map_value(first[i], second[i], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, q, 0)
    return found
