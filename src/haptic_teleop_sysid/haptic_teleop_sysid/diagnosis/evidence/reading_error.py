"""Does the encoder of a rigid joint read another angle at each place? Its curve, without a name.

A loaded potentiometer, a magnet that is off its axis or a tape on a drum reads a smooth function of the
angle. No torque looks like it, and it can be drawn from recordings that drive the joint over its travel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ..policy import HOLDS_BETTER, LEAST_EXPLAINED
from .inverse_dynamics.groups import Search
from .inverse_dynamics.latent import measured_over
from .inverse_dynamics.reading_curve import ReadingCurve
from .inverse_dynamics.regression import equations
from .inverse_dynamics.terms import Hypothesis

#: Knots of the curves that are tried: a sensor that is not straight, and one that errs some times a turn.
_KNOTS = (16, 40)
#: Angles at which the error is told.
_TOLD = 101


@dataclass(frozen=True)
class ReadingError:
    """By what an encoder at ``location`` reads more than the angle: ``error`` (n,), rad, at ``angle`` (n,),
    as it reads; but for a scale and an offset, which nobody can tell from an inertia and a zero.
    ``explained``: share (mean square) of the torque that structure and dry friction leave which it explains
    on recordings to which it was not fitted; ``by_torque``: what the best torque without a form does."""

    location: str
    angle: NDArray[np.float64]
    error: NDArray[np.float64]
    explained: float
    by_torque: float

    @property
    def largest(self) -> float:
        """Largest error, rad."""
        return float(np.max(np.abs(self.error)))

    def content(self, worth: dict[str, Any] | None) -> dict[str, Any]:
        """What diagnosis.json says; ``worth``: what a correction by it is, see `true_readings`."""
        return {
            "what": "what the encoder reads more than the angle, but for a scale and an offset; and share "
            "(mean square) of what is missing that this explains, or the best torque over any quantity",
            "location": self.location,
            "angle": self.angle.tolist(),
            "error": self.error.tolist(),
            "unit": "rad",
            "explained": round(self.explained, 3),
            "by_torque": round(self.by_torque, 3),
            "fit": worth,
        }


def reading_error(
    model: Model, estimation: Sequence[Record], validation: Sequence[Record], cutoff: float
) -> ReadingError | None:
    """The error of a rigid joint's encoder, where it explains LEAST_EXPLAINED of what is missing, and leaves
    less by HOLDS_BETTER than any torque without a form; None where it does not, and of a flexible joint,
    whose place parity equations tell."""
    if not model.rigid:
        return None
    try:
        return _drawn(model, estimation, validation, cutoff)
    except FAILURES:
        return None


def _drawn(
    model: Model, estimation: Sequence[Record], validation: Sequence[Record], cutoff: float
) -> ReadingError | None:
    search = Search(model, *(equations(model, records, cutoff) for records in (estimation, validation)))
    motions = [m for side in search.sides for m in side.side.motions]
    angle = np.concatenate([m.angle[m.kept, 0] for m in motions])
    plainest = next(entry for entry in EFFECTS.values() if entry.jumps)
    dry = Effect(plainest.name, model.location("motor"), {plainest.jumps: 1.0})
    beside = (Hypothesis.resized(dry, "motor"),)
    curves = [ReadingCurve.over(model, angle, number) for number in _KNOTS]
    best = min(curves, key=lambda curve: search.left_over((*beside, curve)))
    torques = [*search.latents, *measured_over(model, motions, "motor")]
    without = 1.0 - search.explained(beside)
    left = (1.0 - search.explained((*beside, best))) / without
    by_torque = min([(1.0 - search.explained((*beside, t))) / without for t in torques], default=1.0)
    if left > 1.0 - LEAST_EXPLAINED or by_torque < HOLDS_BETTER**2 * left:
        return None
    values = search.fitted(0, (*beside, best))
    sizes = model.parameters | dict(zip(search.sides[0].side.names, values.tolist(), strict=False))
    inertia = sizes["motor_inertia"]
    told = np.linspace(best.knots[0][0], best.knots[0][-1], _TOLD)
    own = values[-len(best.bounds()[0]) :]
    stretch = -(best.splines(told) @ own) / inertia
    # The true angle is the integral of 1 + stretch, the error what the reading has more.
    more = -np.concatenate([[0.0], np.cumsum(0.5 * (stretch[1:] + stretch[:-1]) * np.diff(told))])
    error = np.asarray(more - np.polyval(np.polyfit(told, more, 1), told), dtype=np.float64)
    return ReadingError(model.location("motor_encoder"), told, error, 1.0 - left, 1.0 - by_torque)
