"""Names, and what has none, at the place where something acts: parity equations say it without a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.acting_place import ActingPlace
from ..evidence.inverse_dynamics.parity import MOTOR
from ..evidence.inverse_dynamics.terms import follows_from_motion
from ..policy import HOLDS_BETTER
from .beside_the_others import left_out, without
from .reasons import Doubt
from .search import SearchResult
from .verdict import Verdict


def misplaced(
    result: SearchResult, acting: ActingPlace, records: Sequence[Record]
) -> tuple[SearchResult, Doubt | None]:
    """The result without names at places where nothing acts, because what is missing acts at another one;
    ``records``: those of the estimation. The doubt that says so, where no name is left."""
    gone = [
        c for c in result.choices if c.chosen.by_current <= 0.0 and acting.elsewhere(c.chosen.effect)
    ]
    if not gone:
        return result, None
    where = result.baseline.model.location(acting.alone or "")
    whys = [
        f"all that is missing acts at {where}, as the equations of the other places do not hold and its own "
        f"does, and {c.chosen.effect.effect} at {c.chosen.effect.location} does not make that hold better"
        for c in gone
    ]
    if len(gone) == len(result.choices):
        return result.without_names(gone, whys[0]), Doubt(gone[0], whys[0])
    for choice, why in zip(gone, whys, strict=True):
        result = left_out(result, choice, why, without(result.final, choice.chosen.effect, records), records)
    return result, None


def relocated(verdict: Verdict, acting: ActingPlace) -> Verdict:
    """An `unknown` at the place whose parity equation holds, where it leaves less by HOLDS_BETTER than that
    of the place which was told, beside the names that were found."""
    if verdict.kind != "unknown" or not verdict.where:
        return verdict
    told, *others = verdict.where
    left = acting.left([e for e in map(_effect, verdict.findings) if follows_from_motion(e.entry)])
    place = acting.model.place(told["equation"])
    place = MOTOR if place == "actuator" else place
    best = min(left, key=lambda one: left[one])
    if place not in left or left[place] <= HOLDS_BETTER * left[best]:
        return verdict
    return replace(verdict, where=[{**told, "equation": acting.model.location(best)}, *others])


def _effect(finding: dict) -> Effect:
    values = {name: one["value"] for name, one in finding["parameters"].items()}
    return Effect(finding["effect"], finding["location"], values)
