"""The curve that shows a finding: the torque that is missing without it, against the quantity that it
follows, what is still missing with it, and the named law through both.

The torque is that of the observer, run once with the augmented model from which the finding alone is taken
out, and once with it, under the same noise levels: those of the structure alone, whose observer follows what
is missing.  The law is the finding's own equation along the same motion, so that dots off the line are what
the name does not say.  (A component-plus-residual plot: Larsen and McCleary, Technometrics 14(3), 1972.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.likelihood import FAILURES, settled
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.parameter_units import Units
from haptic_teleop_sysid.report import Panel, Plot, Series, unit_text

from .along_motion import torque_along
from .residual import UNITS, Condition, LeftOver, left_over
from .search import SearchResult
from .verdict import Verdict

FloatArray = NDArray[np.float64]

#: Dots of a curve, each the mean of as many samples.
_DOTS = 60
#: What effects follow that no velocity says; all others follow the velocity of their place.
_ANGLE = (
    *("gravity", "spring_to_ground", "torque_ripple", "hard_stop", "detent"),
    "position_dependent_friction",
)
_DEFLECTION = ("backlash", "hardening_spring", "hysteresis", "creep")


@dataclass(frozen=True)
class LawCurve:
    """Means over bins of a ``quantity`` (bins,), in ``unit``: the torque (N·m) missing ``before`` and
    ``after`` the effect called ``name`` is in the model, and its ``law``."""

    name: str
    quantity: str
    unit: str
    centre: FloatArray
    before: FloatArray
    after: FloatArray
    law: FloatArray

    @property
    def explained(self) -> float:
        """Share of the mean square of the curve before that is gone after, 0 to 1."""
        rest = float(np.mean(self.after**2)) / max(float(np.mean(self.before**2)), 1e-300)
        return min(max(1.0 - rest, 0.0), 1.0)


def law_curves(result: SearchResult, records: Sequence[Record]) -> list[LawCurve]:
    """One curve for each finding that is a torque along the motion; ``records``: what was fitted to."""
    found = []
    for choice in result.choices:
        name = choice.chosen.effect
        effects = result.final.model.effects
        fitted = next((e for e in effects if (e.effect, e.location) == (name.effect, name.location)), None)
        if fitted is None or fitted.entry.kind not in ("torque", "friction") or fitted.entry.exogenous:
            continue
        try:
            found.append(_curve(result, fitted, records))
        except FAILURES:  # no observer follows the model without what was found
            continue
    return found


def _curve(result: SearchResult, effect: Effect, records: Sequence[Record]) -> LawCurve:
    place = effect.location.rpartition("_")[2]
    with_it = replace(result.final, noise=result.baseline.noise)
    others = tuple(e for e in with_it.model.effects if e is not effect)
    without = replace(with_it, model=replace(with_it.model, effects=others))
    quantity = _quantity(effect.effect, place)
    parts: list[FloatArray] = []
    for record in records:
        before, after = left_over(without, record), left_over(with_it, record)
        law = torque_along(effect.entry, effect.values, record, _states(before), place)
        read = before.read.astype(np.float64)
        columns = (before.quantities[quantity], _at(before, place), _at(after, place), law, read)
        parts.append(settled(record, np.column_stack(columns)))
    x, *torques, read = np.concatenate(parts).T
    kept = (read > 0.0) & np.all(np.isfinite([x, *torques]), axis=0)
    if np.count_nonzero(kept) < 2 * _DOTS:
        raise ValueError(f"{effect.effect}: too few samples for a curve")
    order = np.argsort(x[kept], kind="stable")
    bins = np.array_split(order, _DOTS)
    means = [np.array([float(np.mean(v[kept][b])) for b in bins]) for v in (x, *torques)]
    called = f"{effect.effect} at {effect.location}"
    return LawCurve(called, quantity, UNITS[quantity], *means)


def _at(found: LeftOver, place: str) -> FloatArray:
    """Torque (n,) missing at a place; in the joint it acts on the arm, and against the motor."""
    motor, arm = found.torque.T
    return motor if place == "motor" else arm if place == "arm" else 0.5 * (arm - motor)


def _states(found: LeftOver) -> FloatArray:
    """Angles and velocities (n, 4) of motor and arm along a recording; a rigid body's arm is its motor."""
    q = found.quantities
    angle, velocity = q["motor angle"], q["motor velocity"]
    return np.column_stack([angle, q.get("arm angle", angle), velocity, q.get("arm velocity", velocity)])


def _quantity(effect: str, place: str) -> str:
    if effect in _DEFLECTION:
        return "deflection"
    if place == "joint":
        return "rate of deflection"
    return f"{place} {'angle' if effect in _ANGLE else 'velocity'}"


def law_plot(curves: Sequence[LawCurve], units: Units) -> Plot:
    """The curves of all findings."""
    force = unit_text(units.force)
    panels = []
    for c in curves:
        lines = [
            Series("missing without it", c.centre, c.before, marks=True),
            Series("still missing with it", c.centre, c.after, "augmented", marks=True),
            Series("the named law", c.centre, c.law, "reference"),
        ]
        axis = f"{c.quantity} ({unit_text(units.restated(c.unit))})"
        panels.append(Panel(f"Torque that is missing: {c.name}", force, lines, (0.0,), x_label=axis))
    return Plot(panels)


def condition_plot(verdict: Verdict, units: Units) -> Plot | None:
    """What the missing torque follows most, before and after, where no finding has a law to show; None where
    there is no curve."""
    panels = []
    for before in [c for c in verdict.before[:2] if len(c.centre)]:
        lines = [Series("missing without a finding", before.centre, before.torque, marks=True)]
        after = _same(before, verdict.remaining)
        if after is not None and after is not before:
            label = "still missing with what was found"
            lines.append(Series(label, after.centre, after.torque, "augmented", marks=True))
        axis = f"{before.name} ({unit_text(units.restated(before.unit))})"
        title = f"Torque that is missing at {before.equation}"
        panels.append(Panel(title, unit_text(units.force), lines, (0.0,), x_label=axis))
    return Plot(panels) if panels else None


def _same(condition: Condition, others: Sequence[Condition]) -> Condition | None:
    wanted = (condition.equation, condition.name)
    return next((c for c in others if (c.equation, c.name) == wanted), None)


def explained_after(condition: Condition, verdict: Verdict) -> float:
    """Share that the same curve still explains with what was found; 0 where there is none."""
    after = _same(condition, verdict.remaining)
    return 0.0 if after is None else max(after.explained, 0.0)
