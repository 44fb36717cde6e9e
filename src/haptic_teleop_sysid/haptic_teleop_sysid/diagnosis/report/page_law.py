"""The curve that shows a finding: the torque that is missing without it, against the quantity that it
follows, what is still missing with it, and the named law through both.

The torque is what the equations of motion lack on the recordings that were fitted to, with the parameters of
the augmented model, in the band of the motion (`inverse_dynamics`): no observer takes part, and no response
is simulated.  Law and quantity go through the same filter, so that corners are as round as those of the dots.
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

from ..decision.search import SearchResult
from ..decision.verdict import Verdict
from ..evidence.inverse_dynamics.motion import BandedMotion, banded, motion_band
from ..evidence.inverse_dynamics.terms import Hypothesis, follows_from_motion
from ..evidence.residual import UNITS, Condition

FloatArray = NDArray[np.float64]

#: Most and fewest dots of a curve, and samples that each is the mean of at least, and where there are more
#: of them.
_MOST_DOTS, _FEWEST_DOTS, _SAMPLES, _WANTED = 60, 8, 4, 8


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


def law_curves(
    result: SearchResult, records: Sequence[Record], stand_in: Mapping[str, Any] | None = None
) -> list[LawCurve]:
    """One curve for each finding that is a torque along the motion, or what an actuator makes of its input at
    once; where nothing was found, for each effect that stands in (`StandIn.content`). ``records``: what was
    fitted to."""
    model = result.final.model
    effects = [e for e in model.effects if _has_law(e)]
    wanted = [(c.chosen.effect.effect, c.chosen.effect.location) for c in result.choices]
    if not wanted and stand_in is not None:
        wanted = [(e["effect"], e["location"]) for e in stand_in["effects"]]
    shown = [e for e in effects if (e.effect, e.location) in wanted and _shows(e)]
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
    name, unit = _quantity(effect)
    found = []
    for motion in motions:
        laws = {id(e): Hypothesis.of(e, _place(e)).columns(motion, model)[:, 0] for e in effects}
        lacking = _lacking(model, motion, int(_place(effect) in ("arm", "joint")))
        others = [e for e in effects if e is not effect and _equation(e) == _equation(effect)]
        before = lacking - sum(laws[id(e)] for e in others)
        found.append(np.column_stack([_followed(motion, name, model), before, laws[id(effect)]]))
    x, before, law = np.concatenate(found).T
    dots = min(len(x) // _SAMPLES, _MOST_DOTS, max(_FEWEST_DOTS, len(x) // _WANTED))
    if dots < _FEWEST_DOTS or not np.all(np.isfinite([x, before, law])):
        return None
    bins = np.array_split(np.argsort(x, kind="stable"), dots)
    means = [np.array([float(np.mean(v[b])) for b in bins]) for v in (x, before, before - law, law)]
    return LawCurve(f"{effect.effect} at {effect.location}", name, unit, *means)


def _has_law(effect: Effect) -> bool:
    """Whether the effect is a torque that follows from motion or input at each moment."""
    return follows_from_motion(effect.entry) or effect.entry.kind == "input"


def _shows(effect: Effect) -> bool:
    """Whether it follows one quantity: what an actuator does late or in time follows none."""
    return effect.entry.kind != "input" or effect.entry.follows == "input"


def _place(effect: Effect) -> str:
    place = effect.location.rpartition("_")[2]
    return "motor" if place == "actuator" else place


def _equation(effect: Effect) -> bool:
    """Whether the effect is told from the arm's equation of motion: the joint's are, too."""
    return _place(effect) in ("arm", "joint")


def _lacking(model: Model, motion: BandedMotion, channel: int) -> FloatArray:
    """What one equation of motion lacks, N·m, at the samples that count: what its effects have to add."""
    p = model.parameters
    elastic = 0.0 if model.rigid else p["stiffness"] * (motion.angle[:, 0] - motion.angle[:, 1])
    a, v = motion.acceleration[:, channel], motion.velocity[:, channel]
    if channel:
        return motion.filtered(p["arm_inertia"] * a + p["arm_damping"] * v - elastic)
    drive = p["torque_constant"] * motion.input
    return motion.filtered(p["motor_inertia"] * a + p["motor_damping"] * v + elastic - drive)


def _followed(motion: BandedMotion, name: str, model: Model) -> FloatArray:
    """The quantity that a law follows, at the samples that count."""
    if name == "input torque":
        return motion.filtered(model.parameters["torque_constant"] * motion.input)
    q, v = motion.angle, motion.velocity
    values = {
        "motor angle": q[:, 0],
        "arm angle": q[:, 1],
        "motor velocity": v[:, 0],
        "arm velocity": v[:, 1],
        "deflection": q[:, 0] - q[:, 1],
        "rate of deflection": v[:, 0] - v[:, 1],
    }
    return motion.filtered(values[name])


def _quantity(effect: Effect) -> tuple[str, str]:
    """What an effect's torque follows, and the unit of that."""
    place = _place(effect)
    if effect.entry.kind == "input":
        name = "input torque"
    elif effect.entry.follows == "deflection":
        name = "deflection"
    elif place == "joint":
        name = "rate of deflection"
    else:
        name = f"{place} {'angle' if effect.entry.follows == 'angle' else 'velocity'}"
    return name, UNITS[name]


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
