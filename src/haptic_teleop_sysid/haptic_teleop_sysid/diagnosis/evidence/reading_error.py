"""Does the encoder of a rigid joint read another angle at each place? Its curve, without a name.

A loaded potentiometer, a magnet that is off its axis or a tape on a drum reads a smooth function of the
angle. It can be drawn from recordings that drive the joint over its travel, and no torque over measured
quantities gives the same: the nearest is an inertia that varies with the angle, which is asked, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ..policy import HOLDS_BETTER, LEAST_EXPLAINED
from .inverse_dynamics.angle_curve import AngleCurve
from .inverse_dynamics.groups import CLEARLY, Search
from .inverse_dynamics.latent import INPUT, measured_over
from .inverse_dynamics.regression import Equations, equations
from .inverse_dynamics.term import Term
from .over_the_input import terms_beside

FloatArray = NDArray[np.float64]

#: Knots of the curves that are tried: a sensor that is not straight, and one that errs some times a turn.
_KNOTS = (16, 40)
#: Angles at which the error is told.
_TOLD = 101


@dataclass(frozen=True)
class ReadingError:
    """By what an encoder at ``location`` reads more than the angle: ``error`` (n,), rad, at ``angle`` (n,),
    as it reads; but for a scale and an offset, which nobody can tell from an inertia and a zero.
    ``explained``: share (mean square) of the torque that structure, dry friction and what is named leave
    which it explains on recordings to which it was not fitted; ``by_torque``: what the best free curve
    does."""

    location: str
    angle: FloatArray
    error: FloatArray
    explained: float
    by_torque: float

    @property
    def largest(self) -> float:
        """Largest error, rad."""
        return float(np.max(np.abs(self.error)))

    def true(self, read: FloatArray) -> FloatArray:
        """Angles (n,) of readings (n,); beyond the curve the error is what it is at its end."""
        return np.asarray(read - np.interp(read, self.angle, self.error))

    def slope(self, read: FloatArray) -> FloatArray:
        """Change of that angle with the reading, (n,)."""
        changes = np.gradient(self.error, self.angle)
        return np.asarray(1.0 - np.interp(read, self.angle, changes, left=0.0, right=0.0))

    def content(self, worth: dict[str, Any] | None) -> dict[str, Any]:
        """What diagnosis.json says; ``worth``: what a correction by it is, see `true_readings`."""
        return {
            "what": "what the encoder reads more than the angle, but for a scale and an offset; and share "
            "(mean square) of what is missing that this explains, or the best torque over any quantity",
            "location": self.location,
            "reading": self.angle.tolist(),
            "error": self.error.tolist(),
            "unit": "rad",
            "explained": round(self.explained, 3),
            "by_torque": round(self.by_torque, 3),
            "fit": worth,
        }


def reading_error(
    model: Model,
    named: Sequence[Effect],
    estimation: Sequence[Record],
    validation: Sequence[Record],
    cutoff: float,
) -> ReadingError | None:
    """The error of a rigid joint's encoder beside what is ``named``, over the travel of all recordings (where
    those of the estimation do not go, it goes on as straight as it can, and is judged); where it explains
    LEAST_EXPLAINED of what is missing on those of the validation, leaves less by HOLDS_BETTER than any free
    curve, is likelier by CLEARLY than any curve of the inertia, and does not fold the angle. None
    where it does not, and of a flexible joint, whose place parity equations tell."""
    if not model.rigid:
        return None
    try:
        here, there = (equations(model, records, cutoff) for records in (estimation, validation))
        travels = [_travel(side) for side in (here, there)]
        return _drawn(model, named, Search(model, here, there), travels)
    except FAILURES:
        return None


def _travel(side: Equations) -> FloatArray:
    """Lowest and highest angle of some recordings, but for the last ones."""
    return np.quantile(np.concatenate([m.angle[m.kept, 0] for m in side.motions]), [0.002, 0.998])


def _drawn(
    model: Model, named: Sequence[Effect], search: Search, travels: Sequence[FloatArray]
) -> ReadingError | None:
    beside = terms_beside(model, named)
    grids = [np.linspace(np.min(travels), np.max(travels), number) for number in _KNOTS]
    rate = _damping_over_inertia(search, beside, model, 0.0, 0.0)
    first = _best(search, beside, [AngleCurve.of_reading(model, knots, rate) for knots in grids])
    less = _less_inertia(search, beside, first)
    rate = _damping_over_inertia(search, (*beside, first), model, less, rate * less)
    curve = _best(search, beside, [AngleCurve.of_reading(model, knots, rate) for knots in grids])
    motions = [m for side in search.sides for m in side.side.motions]
    # The input is nearly the acceleration, which an error over the angle has, too.
    further = [*measured_over(model, motions, "motor")]
    others = (one for one in further if INPUT not in one.quantities or len(one.quantities) == 1)
    torques = [*search.latents, *others]
    without = 1.0 - search.explained(beside)
    left = (1.0 - search.explained((*beside, curve))) / without
    by_torque = min((1.0 - search.explained((*beside, one))) / without for one in torques)
    if left > 1.0 - LEAST_EXPLAINED or by_torque < HOLDS_BETTER**2 * left:
        return None
    whole = (*beside, curve)
    search.count(whole)
    inertia = _best(search, beside, [AngleCurve.of_inertia(model, knots) for knots in grids])
    if search.likelier(whole) < search.likelier((*beside, inertia)) + CLEARLY:
        return None
    told, error = _error(search, whole, curve, model)
    found = ReadingError(model.location("motor_encoder"), told, error, 1.0 - left, 1.0 - by_torque)
    return found if np.all(found.slope(told) > 0.0) else None


def _best(search: Search, beside: tuple[Term, ...], curves: Sequence[AngleCurve]) -> AngleCurve:
    return min(curves, key=lambda curve: search.left_over((*beside, curve)))


def _sizes(search: Search, terms: tuple[Term, ...], model: Model) -> tuple[FloatArray, dict[str, float]]:
    """All factors of a group on the estimation's side, and the structure's parameters."""
    values = search.fitted(0, terms)
    return values, {**model.parameters} | dict(zip(search.sides[0].side.names, values.tolist(), strict=False))


def _less_inertia(search: Search, beside: tuple[Term, ...], curve: AngleCurve) -> float:
    """By how much less than the structure's the inertia of a curve is on average."""
    values = search.fitted(0, (*beside, curve))
    angle = np.linspace(curve.knots[0][0], curve.knots[0][-1], _TOLD)
    return float(np.mean(curve.splines(angle) @ values[-len(curve.bounds()[0]) :]))


def _damping_over_inertia(
    search: Search, terms: tuple[Term, ...], model: Model, less_inertia: float, less_damping: float
) -> float:
    """The structure's, 1/s, with what a curve takes from either on average."""
    _, sizes = _sizes(search, terms, model)
    damping, inertia = sizes["motor_damping"] - less_damping, sizes["motor_inertia"] - less_inertia
    return max(damping, 0.0) / inertia if inertia > 0.0 else 0.0


def _error(
    search: Search, terms: tuple[Term, ...], curve: AngleCurve, model: Model
) -> tuple[FloatArray, FloatArray]:
    """Readings and error: J g'(m) integrated, with the scale that makes its mean slope 1."""
    values, sizes = _sizes(search, terms, model)
    told = np.linspace(curve.knots[0][0], curve.knots[0][-1], _TOLD)
    stretch = sizes["motor_inertia"] - curve.splines(told) @ values[-len(curve.bounds()[0]) :]
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (stretch[1:] + stretch[:-1]) * np.diff(told))])
    slope, offset = np.polyfit(told, angle, 1)
    return told, np.asarray(told - (angle - offset) / slope, dtype=np.float64)
