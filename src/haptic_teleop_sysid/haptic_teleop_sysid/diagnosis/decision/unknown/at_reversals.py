"""Friction that shows where the motion turns, whatever else is named or has no name.

Whether a name stands beside physics without one is asked of likelihoods and of torques along the whole motion
(`in_part`); where that physics is large, friction of a tenth of the torque is lost in it there. At the
reversals of the motion it is not (`evidence.reversals`). Nobody is sure of what is seen only there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from haptic_teleop_sim.effects import EFFECTS, locations
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.reversals import Jump, jump
from ...hypotheses.candidates import family
from ...hypotheses.explanation import Explanation
from ...policy import LEAST_JUMP, SURE_JUMP
from ..adequacy import NOT_SURE
from ..finding import finding
from ..name_tests.objections import OTHER_SIZE
from ..search.decide import Choice
from ..search.rounds import SearchResult
from ..verdict import Verdict
from ..where import where_left

#: Standard errors that it must have on the recordings of either kind, too.
SEEN_TWICE = 2.0


@dataclass(frozen=True)
class AtReversals:
    """A torque that jumps: ``effect``, ``location``, and the `Jump` on the recordings of both kinds."""

    effect: str
    location: str
    jumps: tuple[Jump, Jump]

    @property
    def size(self) -> float:
        """N·m, the mean of both kinds, by what their standard errors say of them."""
        weights = [1.0 / max(j.std, 1e-300) ** 2 for j in self.jumps]
        return sum(w * j.size for w, j in zip(weights, self.jumps, strict=True)) / sum(weights)

    @property
    def pooled(self) -> float:
        """N·m: standard error of that."""
        return 1.0 / math.sqrt(sum(1.0 / max(j.std, 1e-300) ** 2 for j in self.jumps))

    @property
    def std(self) -> float:
        """N·m: with what puts the two kinds apart, and what both have in common."""
        here, there = self.jumps
        return math.hypot(self.pooled, 0.5 * (here.size - there.size), self.common)

    @property
    def common(self) -> float:
        """N·m: error that the jumps of both kinds share."""
        return max(j.common for j in self.jumps)

    @property
    def stands(self) -> bool:
        """Whether it is there, on both kinds, of one size, and worth a word on one of them."""
        sizes = [j.size for j in self.jumps]
        clear = all(j.size > SEEN_TWICE * math.hypot(j.std, j.common) for j in self.jumps)
        alike = abs(sizes[0] - sizes[1]) <= OTHER_SIZE * max(sizes)
        return clear and alike and self.size > max(SURE_JUMP * self.pooled, self.least)

    @property
    def least(self) -> float:
        """N·m: the smallest that is worth a word on the recordings of either kind."""
        return LEAST_JUMP * min(j.input for j in self.jumps)

    @property
    def absent(self) -> bool:
        """Whether the smallest jump that is worth a word would be seen, and none as large is."""
        largest = self.size + SEEN_TWICE * math.hypot(self.pooled, self.common)
        return not self.stands and max(SURE_JUMP * self.pooled, largest) < self.least

    def content(self) -> dict[str, Any]:
        """What diagnosis.json says."""
        kinds = zip(("estimation", "validation"), self.jumps, strict=True)
        return {
            "effect": self.effect,
            "location": self.location,
            "torque": {"value": self.size, "std": self.std, "unit": "N*m"},
            **{
                k: {"value": j.size, "std": math.hypot(j.std, j.common), "reversals": j.reversals}
                for k, j in kinds
            },
        }

    def told(self) -> str:
        """What speaks for it, in words."""
        numbers = " and ".join(
            f"{j.size:.3g} ± {math.hypot(j.std, j.common):.2g} N*m" for j in self.jumps
        )
        count = " and ".join(str(j.reversals) for j in self.jumps)
        return (
            f"where the motion turns ({count} times), the torque jumps by twice {numbers} on the recordings "
            "of either kind, whatever else acts there"
        )


@dataclass(frozen=True)
class Turning:
    """What is seen where the motion turns: ``jumps``, at most one an effect; ``smooth``: effects and
    locations where a jump would be seen, and none is."""

    jumps: tuple[AtReversals, ...] = ()
    smooth: frozenset[tuple[str, str]] = frozenset()

    def size_of(self, effect: str, location: str) -> float | None:
        """The size, N·m, with which a form of it is seen there; None where none is."""
        own = (j.size for j in self.jumps if location == j.location and effect in family(j.effect))
        return next(own, None)

    def not_seen(self, effect: str, location: str) -> bool:
        """Whether it should be seen there, if it is of a kind that jumps, and is not."""
        return any(location == place and effect in family(name) for name, place in self.smooth)


def where_torque_jumps(
    baseline: Fit,
    learn: Sequence[Record],
    judge: Sequence[Record],
    inertias: Sequence[float] = (),
) -> Turning:
    """The effects whose torque jumps where the motion turns, with their places; ``baseline``: the
    re-estimated structure; ``inertias``: what else is known of the motor's, kg·m². Those of which the model
    has a form already are not asked for."""
    model = baseline.model
    there = {e.effect for e in model.effects}
    jumps, smooth = [], set()
    for name in (n for n, e in EFFECTS.items() if e.jumps and not family(n) & there):
        found = [
            one
            for place in ("motor", "arm")
            if place in locations(name, model.structure)
            and (one := _both(name, model, (learn, judge), place, inertias)) is not None
        ]
        smooth |= {(name, one.location) for one in found if one.absent}
        jumps += _place_of(found, model)
    return Turning(tuple(jumps), frozenset(smooth))


def with_friction(
    verdict: Verdict, turning: Turning, result: SearchResult, learn: Sequence[Record]
) -> Verdict:
    """The verdict with what jumps where the motion turns and no finding names in any form: beside names that
    stand, as one that nobody is sure of; alone, or beside something unknown, as what is found of that."""
    for one in turning.jumps:
        # What surely follows the direction of the motion there jumps, too: friction by the load carried.
        there = any(_jumps_there(f, one.location) for f in verdict.findings)
        if not there and not family(one.effect) & {f["effect"] for f in verdict.findings}:
            kind, where = verdict.kind, verdict.where
            if kind == "no_mismatch":
                kind, where = "unknown", [where_left(result, verdict.remaining, learn)]
            findings = [*verdict.findings, _finding(one, result.baseline)]
            verdict = replace(verdict, kind=kind, where=where, findings=findings)
    return verdict


def _jumps_there(finding: dict[str, Any], location: str) -> bool:
    """Whether a finding is at that place, surer than what is seen there alone, and turns with the motion."""
    sure = finding["confidence"] > NOT_SURE
    return sure and finding["location"] == location and bool(EFFECTS[finding["effect"]].memory)


def _place_of(found: Sequence[AtReversals], model: Model) -> list[AtReversals]:
    """The one, of the motor and the arm, at whose reversals the torque jumps, if any. The motor's own
    equation sees the motor's alone; the sum of both, at the reversals of the arm, sees either: that is the
    arm's where the motor's equation has clearly less of it."""
    at = {model.place(one.location): one for one in found}
    motor, arm = at.get("motor"), at.get("arm")
    if motor is not None and motor.stands:
        return [motor]
    if arm is None or motor is None or not arm.stands:
        return []
    return [arm] if motor.size + 2.0 * motor.pooled < arm.size else []


def _both(
    name: str, model: Model, kinds: Sequence[Sequence[Record]], place: str, inertias: Sequence[float]
) -> AtReversals | None:
    here, there = (jump(model, records, place, inertias) for records in kinds)
    return None if here is None or there is None else AtReversals(name, model.location(place), (here, there))


def _finding(found: AtReversals, baseline: Fit) -> dict[str, Any]:
    """The finding, with the size that the jump has."""
    effect = Effect(found.effect, found.location, {EFFECTS[found.effect].jumps: found.size})
    return seen_apart(effect, found.std, found.told(), baseline)


def seen_apart(friction: Effect, std: float, told: str, baseline: Fit) -> dict[str, Any]:
    """The finding of a plain friction that is seen elsewhere than in a model, so that nobody is sure of it;
    ``std``: of its size, ``told``: what speaks for it, ``baseline``: the re-estimated structure."""
    model = baseline.model
    fit = replace(baseline, model=model.with_effects(friction))
    errors = {f"{friction.location}.{friction.effect}.{friction.entry.jumps}": std}
    explanation = Explanation(fit, 0.0, 0.0, True, len(model.effects), std=errors, grounds=told)
    return finding(Choice(explanation, NOT_SURE), fit, {}, NOT_SURE)
