"""Names, and what has none, at the place where something acts: parity equations say it without a name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.acting_place import ActingPlace
from ..evidence.inverse_dynamics.parity import ENCODERS, MOTOR
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


def at_its_place(
    verdict: Verdict, acting: ActingPlace, left: Mapping[str, float] | None = None
) -> tuple[Verdict, str | None]:
    """An `unknown` at the place whose parity equation holds, where it leaves less by HOLDS_BETTER than that
    of the place which was told; and that place where it is an encoder, else None. ``left``: by place, see
    `left_beside`."""
    if verdict.kind != "unknown" or not verdict.where:
        return verdict, None
    left = left_beside(verdict, acting) if left is None else left
    told, *others = verdict.where
    place = acting.model.place(told["equation"])
    place = MOTOR if place == "actuator" else place
    best = min(left, key=lambda one: left[one])
    if place not in left or left[place] <= HOLDS_BETTER * left[best]:
        return verdict, None
    where, share = acting.model.location(best), round(1.0 - (left[best] / left[place]) ** 2, 3)
    moved = replace(verdict, where=[{**told, "equation": where, "share": share}, *others])
    return moved, where if best in ENCODERS else None


def left_beside(verdict: Verdict, acting: ActingPlace) -> dict[str, float]:
    """What the parity equations leave beside the findings that are torques along the motion."""
    found = [
        Effect(f["effect"], f["location"], {name: one["value"] for name, one in f["parameters"].items()})
        for f in verdict.findings
    ]
    return acting.left([effect for effect in found if follows_from_motion(effect.entry)])
