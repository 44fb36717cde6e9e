"""Filters with an exact discretisation, compiled, for a handful of channels at a time.

Between two samples the input is taken to be a straight line (first-order hold). Under that assumption the
filters have no discretisation error at all: a ramp gives its slope, whatever the sampling time.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.robots import VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING

Array = NDArray[np.float64]


class VelocityFilter:
    """Velocity from position, n channels: H(s) = s wc² / (s² + 2 zeta wc s + wc²).

    The filter of the 2DSFJ and of the Omni (40 Hz, damping 0.9). With x1 the filtered position and x2 its
    rate, x1' = x2, x2' = wc² (u - x1) - 2 zeta wc x2, output x2.

    n: channels. dt: s. cutoff_hz: Hz, above zero (the discretisation is exact, so it may exceed the Nyquist
    frequency).
    damping: above zero. Raises ConfigurationError for anything else.
    """

    def __init__(
        self,
        n: int,
        dt: float,
        cutoff_hz: float = VELOCITY_FILTER_CUTOFF_HZ,
        damping: float = VELOCITY_FILTER_DAMPING,
    ) -> None:
        _check(n=n, dt=dt, cutoff_hz=cutoff_hz)
        if not (math.isfinite(damping) and damping > 0.0):
            raise ConfigurationError(
                f"velocity filter: damping is {damping}; choose a finite number above 0."
            )
        self.dt = float(dt)
        self.cutoff_hz = float(cutoff_hz)
        self.damping = float(damping)
        self._position = np.zeros(n)
        self._state = np.zeros((n, 3))  # filtered position, its rate, last position
        self._started = False
        self._coefficients = velocity_coefficients(self.dt, self.cutoff_hz, self.damping)
        velocity_step(self._position, self._state.copy(), self._coefficients)  # compiles now, not in the loop

    def step(self, position: ArrayLike, dt: float | None = None) -> Array:
        """Velocity (n,), rad/s, at the sample `position` (n,), rad.

        dt: s since the previous sample where it is not the nominal one; the coefficients are then computed
        anew. A time that is not finite and above zero is taken as the nominal one.
        The first sample after construction is taken as the rest position and gives zero, unless `reset` was
        called. A channel whose position is not finite (or overflows) gives NaN for that sample and keeps its
        state. Raises ValueError when `position` does not have n values.
        """
        self._position[:] = position
        if not self._started:
            self.reset(self._position)
        if dt is None or dt == self.dt or not 0.0 < dt < math.inf:
            return velocity_step(self._position, self._state, self._coefficients)
        coefficients = velocity_coefficients(float(dt), self.cutoff_hz, self.damping)
        return velocity_step(self._position, self._state, coefficients)

    def reset(self, position: ArrayLike = 0.0, velocity: ArrayLike = 0.0) -> None:
        """Start as if the input had always moved with `velocity` (rad/s) and had now reached `position`
        (rad)."""
        wc = 2.0 * math.pi * self.cutoff_hz
        start = np.nan_to_num(np.broadcast_to(np.asarray(position, dtype=np.float64), self._position.shape))
        self._state[:, 1] = velocity
        self._state[:, 0] = start - 2.0 * self.damping / wc * self._state[:, 1]
        self._state[:, 2] = start
        self._started = True


def _check(n: int, dt: float, cutoff_hz: float) -> None:
    if n < 1:
        raise ConfigurationError(f"filter: {n} channels; give at least one.")
    if not (math.isfinite(dt) and dt > 0.0):
        raise ConfigurationError(f"filter: dt is {dt} s; choose a finite time above 0.")
    if not (math.isfinite(cutoff_hz) and cutoff_hz > 0.0):
        raise ConfigurationError(f"filter: cutoff_hz is {cutoff_hz}; choose a finite frequency above 0.")


@njit(cache=True)
def _product(a: Array, b: Array, out: Array) -> None:  # type: ignore[type-arg]
    """The product of two matrices (4, 4) into `out`."""
    for row in range(4):
        for column in range(4):
            total = 0.0
            for k in range(4):
                total += a[row, k] * b[k, column]
            out[row, column] = total


@njit(cache=True)
def velocity_coefficients(dt: float, cutoff_hz: float, damping: float) -> Array:  # type: ignore[type-arg]
    """First-order hold of the velocity filter over dt: (2, 4), rows (x1, x2), columns (x1, x2, u now, u
    next).

    The block matrix [[A, B, 0], [0, 0, 1/dt], [0, 0, 0]] carries state, input and the input's increment; its
    exponential over dt holds the transition and both input terms.
    """
    # With x2 counted in wc all entries are of one size, and little is left to scale.
    step = 2.0 * math.pi * cutoff_hz * dt
    a = np.zeros((4, 4))
    a[0, 1] = step
    a[1, 0] = -step
    a[1, 1] = -2.0 * damping * step
    a[1, 2] = step
    a[2, 3] = 1.0
    # Scaling and squaring with a Taylor series: entries halved below 1/16, 12 terms leave less than rounding.
    # By elements: the products, maxima and unit matrices of the library take three times as long to compile.
    norm = 0.0
    for row in range(4):
        for column in range(4):
            norm = max(norm, abs(a[row, column]))
    halvings = max(0, math.ceil(math.log2(norm)) + 4) if norm > 0.0 else 0
    term, total, work = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    for row in range(4):
        term[row, row] = total[row, row] = 1.0
        for column in range(4):
            a[row, column] /= 2.0**halvings
    for order in range(1, 13):
        _product(term, a, work)
        for row in range(4):
            for column in range(4):
                term[row, column] = work[row, column] / order
                total[row, column] += term[row, column]
    for _ in range(halvings):
        _product(total, total, work)
        total, work = work, total
    wc = 2.0 * math.pi * cutoff_hz
    total[0, 1] /= wc
    for column in range(4):
        total[1, column] *= wc
    total[1, 1] /= wc
    out = np.empty((2, 4))
    for row in range(2):
        out[row, 0] = total[row, 0]
        out[row, 1] = total[row, 1]
        out[row, 2] = total[row, 2] - total[row, 3]
        out[row, 3] = total[row, 3]
    return out


@njit(cache=True)
def velocity_step(position: Array, state: Array, c: Array) -> Array:  # type: ignore[type-arg]
    """One sample of the velocity filter: position (n,), state (n, 3) changed in place, c from
    `velocity_coefficients`; velocity (n,)."""
    velocity = np.empty(position.shape[0])
    for i in range(position.shape[0]):
        velocity[i] = velocity_of(position[i], state, i, c)
    return velocity


@njit(cache=True)
def velocity_of(u: float, state: Array, i: int, c: Array) -> float:
    """The same for one position, of row ``i`` of the state: long series spare the array for the result."""
    # Relative to the last position, so that many turns away from zero cost no precision.
    origin = state[i, 2]
    x1 = state[i, 0] - origin
    x2 = state[i, 1]
    du = u - origin
    filtered = origin + (c[0, 0] * x1 + c[0, 1] * x2 + c[0, 3] * du)
    rate = c[1, 0] * x1 + c[1, 1] * x2 + c[1, 3] * du
    if not (math.isfinite(filtered) and math.isfinite(rate)):
        return math.nan
    state[i, 0] = filtered
    state[i, 1] = rate
    state[i, 2] = u
    return rate


@njit(cache=True)
def low_pass_coefficients(dt: float, cutoff_hz: float) -> Array:  # type: ignore[type-arg]
    """First-order hold of the low-pass over dt: (3,), factors of the output, the input now, the input
    next."""
    if math.isinf(cutoff_hz):
        return np.array([0.0, 0.0, 1.0])
    step = 2.0 * math.pi * cutoff_hz * dt
    a = math.exp(-step)
    mean = -math.expm1(-step) / step
    return np.array([a, mean - a, 1.0 - mean])
