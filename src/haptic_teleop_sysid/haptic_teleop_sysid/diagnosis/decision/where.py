"""Where something is missing, and under which condition, in the terms of diagnosis.json."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from haptic_teleop_sim.effects import effect_entry
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.residual import Condition, intervals, shares
from ..policy import LEAST_EXPLAINED, NOTICEABLE, STRUCTURED
from .adequacy import explained_torque
from .reasons import Doubt
from .search.rounds import SearchResult

#: Share of the left-over torque that a curve explains, from which the place of something unknown is told with
#: what it follows.
FOLLOWS = 0.2


def structured(
    fit: Fit, found: Sequence[Condition], records: Sequence[Record], result: SearchResult
) -> Condition | None:
    """What the left-over torque noticeably depends on, or None."""
    if not found or found[0].explained < STRUCTURED:
        return None
    best = found[0]
    return best if best.size > NOTICEABLE * result.scales.size["torque"] else None


def where_found(
    result: SearchResult,
    before: Sequence[Condition],
    estimation: Sequence[Record],
    unexplained: Condition | None,
) -> list[dict[str, Any]]:
    if unexplained is not None:
        return [where_left(result, [unexplained], estimation)]
    if not result.choices:
        return []
    total = sum(max(c.chosen.score, 0.0) for c in result.choices) or 1.0
    rows = []
    fit = result.baseline
    for choice in sorted(result.choices, key=lambda c: -c.chosen.score):
        effect = choice.chosen.effect
        rows.append(
            {
                "equation": effect.location,
                "share": round(max(choice.chosen.score, 0.0) / total, 3),
                "condition": condition_of(result.baseline.model, effect.effect, effect.location, before),
                "intervals": [list(i) for i in intervals(fit, result.final, estimation[0])],
            }
        )
    return rows


def where_left(
    result: SearchResult, remaining: Sequence[Condition], estimation: Sequence[Record]
) -> dict[str, Any]:
    """Where most of the torque acts that the final model lacks, and what it follows."""
    place, share = _largest(result.final, estimation)
    return {"equation": place, "share": round(share, 3), "condition": followed(remaining), "intervals": []}


def followed(left: Sequence[Condition]) -> str:
    """What a left-over torque follows, the strongest first; what follows nothing else comes and goes with
    time."""
    return left[0].name if left and left[0].explained > FOLLOWS else "time"


def doubtful_place(
    doubt: Doubt, result: SearchResult, before: Sequence[Condition], estimation: Sequence[Record]
) -> dict[str, Any]:
    """Where the unnamed physics sits: where the doubt says; at the place of the name that was given up, if
    that explains most of what is missing; else where most of the torque acts that the observer adds."""
    model = result.baseline.model
    place, share = _largest(result.baseline, estimation)
    condition = followed(before)
    if doubt.place is not None:
        place, condition = doubt.place, "time"
        share = shares(result.baseline, estimation).get(model.place(place), share)
    elif doubt.choice is not None:
        effect, fit = doubt.choice.chosen.effect, doubt.choice.chosen.fit
        # Where it explains too little on all recordings, on some of them it may explain most.
        most = not doubt.short and explained_torque(result.baseline, fit, estimation) > LEAST_EXPLAINED
        if effect.location == place or most:
            place, condition = effect.location, condition_of(model, effect.effect, effect.location, before)
    return {
        "equation": place,
        "share": round(share, 3),
        "condition": doubt.condition or condition,
        "intervals": [list(i) for i in doubt.intervals],
    }


def _largest(fit: Fit, records: Sequence[Record]) -> tuple[str, float]:
    """Location of most of the torque that the observer of a fit adds, and its share."""
    place, share = max(shares(fit, records).items(), key=lambda found: found[1])
    return fit.model.location(place), share


def condition_of(model: Model, effect: str, location: str, before: Sequence[Condition]) -> str:
    """Under which condition the effect shows, in words."""
    part = "arm" if "_arm" in location else "motor"
    words = effect_entry(effect).condition_in(model.place(location)) or "input"
    return words.format(v=f"{part} velocity", q=f"{part} angle")
