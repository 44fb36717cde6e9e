"""How the arm of a flexible joint follows its motor."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class ArmResponse:
    """q_a = H q_m with H = f / (s^2 + d s + f), where ``stiffness`` f (1/s^2) and ``damping`` d (1/s) are
    over the arm's inertia; exact for a signal that is straight between samples of ``dt`` s."""

    def __init__(self, stiffness: float, damping: float, dt: float) -> None:
        self.stiffness, self.damping, self._dt = stiffness, damping, dt
        self._filter = _discrete(stiffness, damping, dt)

    def __call__(self, values: FloatArray) -> FloatArray:
        """The signal (n,) as the arm follows it, from rest at its first value."""
        return self.each(values[:, None])[:, 0]

    def each(self, columns: FloatArray) -> FloatArray:
        """Columns (n, p) as the arm follows them."""
        if not columns.shape[1]:
            return columns
        return np.asarray(columns[0] + scipy.signal.lfilter(*self._filter, columns - columns[0], axis=0))

    def by_itself(self, n: int) -> FloatArray:
        """How the arm swings where nothing moves the motor, (n, 2): from any angle and velocity it is a sum
        of both columns."""
        _, denominator = self._filter
        # Memories of the filter with which it says 1, 1 and 0, 1 first.
        begins = np.array([[1.0, 0.0], [1.0 + denominator[1], 1.0]])
        return np.asarray(scipy.signal.lfilter(*self._filter, np.zeros((n, 2)), axis=0, zi=begins)[0])


@lru_cache(maxsize=8)
def _discrete(stiffness: float, damping: float, dt: float) -> tuple[FloatArray, FloatArray]:
    """Numerator and denominator; recordings of one joint are mostly of one rate."""
    system = ([stiffness], [1.0, damping, stiffness])
    numerator, denominator, _ = scipy.signal.cont2discrete(system, dt, "foh")
    return np.ravel(numerator), np.ravel(denominator)
