"""Any smooth curve over the angle: of an encoder that reads another angle there, and of an inertia.

    q = g(m):    K u = J g'(m) a + J g''(m) v² + b g'(m) v        of a rigid joint whose encoder reads m;
    J(q):        K u = J(q) a + J'(q) v² / 2 + b v                 of one whose inertia varies,

with angle, velocity v and acceleration a as they are read. Half of the term in v², and the damping, which
varies alike, tell them apart.
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
class AngleCurve(Latent):
    """Either of them as a free curve, with factors that are those of an inertia (kg·m²) by which
    the one at an angle is less than the structure's: quadratic splines over evenly spaced ``knots``;
    ``rate``: damping that varies with it, 1/s; ``square``: of the term in v²."""

    rate: float = 0.0
    square: float = 1.0

    @staticmethod
    def of_reading(model: Model, knots: FloatArray, rate: float) -> AngleCurve:
        """The curve of an encoder; ``rate``: damping over inertia, 1/s."""
        return AngleCurve(
            model.location("motor"), "motor", ("motor angle",), (tuple(knots.tolist()),), 0.0, (), rate
        )

    @staticmethod
    def of_inertia(model: Model, knots: FloatArray) -> AngleCurve:
        """The curve of an inertia."""
        return AngleCurve(
            model.location("motor"), "motor", ("motor angle",), (tuple(knots.tolist()),), 0.0, (), 0.0, 0.5
        )

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """See `Term.columns`."""
        angle, v, a = (x[:, 0] for x in (motion.angle, motion.velocity, motion.acceleration))
        found = self.splines(angle) * (a + self.rate * v)[:, None]
        found += self.splines(angle, 1) * (self.square * v**2)[:, None]
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
