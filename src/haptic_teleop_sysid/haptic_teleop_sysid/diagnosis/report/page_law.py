"""The curve that shows a finding: the torque that is missing without it, against the quantity that it
follows, what is still missing with it, and the named law through both.

The torque is what the equations of motion lack on the recordings that were fitted to, with the parameters of
the augmented model (`law_torque`).  What changes in the course of a recording swings with the motion: its
torque is drawn over time as far as it acts in the direction of the law.
(A component-plus-residual plot: Larsen and McCleary, Technometrics 14(3), 1972.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.report import Panel, Plot, Series, unit_text

from ..decision.search.rounds import SearchResult
from ..decision.verdict import Verdict
from ..evidence.inverse_dynamics.band import motion_band
from ..evidence.inverse_dynamics.motion import BandedMotion, banded
from ..evidence.residual import Condition
from .law_torque import TIME, followed, has_law, lacking, law_torque, on_arm, quantity

FloatArray = NDArray[np.float64]

#: Most and fewest dots of a curve, and samples that each is the mean of at least, and where there are more
#: of them.
_MOST_DOTS, _FEWEST_DOTS, _SAMPLES, _WANTED = 60, 8, 4, 8
#: The same over time, where each has to hold a few swings of the motion.
_MOST_TIMES = 24
#: Share of its greatest size from which a law over time counts as there.
_THERE = 0.5


@dataclass(frozen=True)
class LawCurve:
    """Means over bins of a ``quantity`` (bins,), in ``unit``: the torque (N·m) missing ``before`` and
    ``after`` the effect called ``name`` is in the model, and its ``law``; over time all three as far as they
    act in the direction of the law. ``place``: the effect's location."""

    name: str
    place: str
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

    @property
    def there(self) -> tuple[float, float] | None:
        """Of a law over time: from when until when (s) it has half of its greatest size; None of another."""
        if self.quantity != TIME:
            return None
        strong = self.centre[np.abs(self.law) >= _THERE * np.max(np.abs(self.law))]
        return float(strong[0]), float(strong[-1])


def law_curves(
    result: SearchResult, records: Sequence[Record], stand_in: Mapping[str, Any] | None = None
) -> list[LawCurve]:
    """One curve for each finding that is a torque along motion, time or input; where nothing was found, for
    each effect that stands in (`StandIn.content`). ``records``: what was fitted to."""
    model = result.final.model
    effects = [e for e in model.effects if has_law(e)]
    wanted = [(c.chosen.effect.effect, c.chosen.effect.location) for c in result.choices]
    if not wanted and stand_in is not None:
        wanted = [(e["effect"], e["location"]) for e in stand_in["effects"]]
    shown = [e for e in effects if (e.effect, e.location) in wanted]
    if not shown:
        return []
    cutoff = motion_band(records)
    motions = [banded(r, model.rigid, cutoff) for r in records]
    return [c for e in shown if (c := law_curve(model, e, effects, motions)) is not None]


def law_curve(
    model: Model, effect: Effect, effects: Sequence[Effect], motions: Sequence[BandedMotion]
) -> LawCurve | None:
    """The curve of one effect of the ``effects`` of a model that have a law; None where too few samples
    count."""
    name, unit = quantity(effect)
    found = []
    for motion in motions:
        law = law_torque(effect, effects, motion, model)
        others = [e for e in effects if e is not effect and on_arm(e) == on_arm(effect)]
        before = lacking(model, motion, on_arm(effect))
        before = before - sum(law_torque(e, effects, motion, model) for e in others)
        along = np.sign(law) if name == TIME else 1.0
        found.append(np.column_stack([followed(motion, name, model), along * before, along * law]))
    x, before, law = np.concatenate(found).T
    most = _MOST_TIMES if name == TIME else _MOST_DOTS
    dots = min(len(x) // _SAMPLES, most, max(_FEWEST_DOTS, len(x) // _WANTED))
    if dots < _FEWEST_DOTS or not np.all(np.isfinite([x, before, law])):
        return None
    bins = np.array_split(np.argsort(x, kind="stable"), dots)
    means = [np.array([float(np.mean(v[b])) for b in bins]) for v in (x, before, before - law, law)]
    return LawCurve(f"{effect.effect} at {effect.location}", effect.location, name, unit, *means)


def law_plot(curves: Sequence[LawCurve], units: Units) -> Plot:
    """The curves of all findings."""
    force = unit_text(units.force)
    panels = []
    for c in curves:
        lines = [
            Series("missing without it", c.centre, c.before, marks=True, line=False),
            Series("still missing with it", c.centre, c.after, "augmented"),
            Series("the named law", c.centre, c.law, "reference"),
        ]
        axis = f"{c.quantity} ({unit_text(units.restated(c.unit))})"
        along = ", in the direction of the law" if c.quantity == TIME else ""
        title = f"Torque that is missing{along}: {c.name}"
        panels.append(Panel(title, force, lines, (0.0,), x_label=axis))
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
