"""An encoder that reads another angle at each place: any smooth curve over what it reads.

    q = g(m):    K u = J g'(m) a + J g''(m) v² + b g'(m) v        of a rigid joint,

with angle m, velocity v and acceleration a as they are read. It resembles an inertia that varies with the
angle, but for half of the term in v² and for the damping, which varies alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from haptic_teleop_sim.model import Model

from .latent import SLIGHT, Latent
from .motion import BandedMotion

FloatArray = NDArray[np.float64]

_DEGREE = 2


@dataclass(frozen=True, eq=False)
class ReadingCurve(Latent):
    """What a curve of readings over the motor's angle looks like to the equation: a torque, with factors that
    are those of an inertia (kg·m²) by which J g'(m) is less than J; quadratic splines over evenly spaced
    ``knots``; ``rate``: damping over inertia, 1/s."""

    rate: float = 0.0

    @staticmethod
    def over(model: Model, angle: FloatArray, number: int) -> ReadingCurve:
        """The curve over nearly all of some angles (n,) with a ``number`` of knots."""
        low, high = np.quantile(angle, [0.002, 0.998])
        knots = tuple(np.linspace(low, high, number).tolist())
        rate = model.parameters["motor_damping"] / model.parameters["motor_inertia"]
        return ReadingCurve(model.location("motor"), "motor", ("motor angle",), (knots,), 0.0, (), rate)

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """See `Term.columns`."""
        angle, v, a = (x[:, 0] for x in (motion.angle, motion.velocity, motion.acceleration))
        stretch = a + self.rate * v
        found = self.splines(angle) * stretch[:, None] + self.splines(angle, 1) * (v**2)[:, None]
        return motion.filtered(found, times=2)

    def splines(self, angle: FloatArray, derivative: int = 0) -> FloatArray:
        """Splines (n, columns) at angles (n,), or their derivatives; constant beyond the knots."""
        first, *_, last = self.knots[0]
        every = np.r_[[first] * _DEGREE, self.knots[0], [last] * _DEGREE]
        basis = BSpline(every, np.eye(self._number), _DEGREE)
        inside = np.clip(angle, first, last)
        if not derivative:
            return np.asarray(basis(inside))
        return np.where((angle == inside)[:, None], basis.derivative(derivative)(inside), 0.0)

    def bends(self) -> FloatArray:
        """See `Latent.bends`."""
        whole = np.eye(self._number)
        return np.concatenate([SLIGHT * whole, np.diff(whole, 2, axis=0)])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """No bounds on any column."""
        return np.full(self._number, -np.inf), np.full(self._number, np.inf)

    @property
    def _number(self) -> int:
        return len(self.knots[0]) + _DEGREE - 1
