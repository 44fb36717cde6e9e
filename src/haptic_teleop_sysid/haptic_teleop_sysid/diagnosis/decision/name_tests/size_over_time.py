"""A name whose torque has another size in each stretch of the recordings is no constant of the joint."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from haptic_teleop_sysid.estimation.records import Record

from ...evidence.steadiness import Steadiness
from ...policy import LEAST_KNOWN
from ..finding import KNOWN, chance_within
from ..reasons import Doubt
from ..search.decide import Choice
from ..search.rounds import SearchResult
from .beside_the_others import left_out, without


def constant_sizes(
    result: SearchResult,
    steady: Callable[[SearchResult], Mapping[tuple[str, str], Steadiness]],
    records: Sequence[Record],
) -> tuple[SearchResult, Doubt | None]:
    """The result without names of which the torques want another size, or another one in each stretch of the
    recordings: what the size is off by (`Steadiness.off`) leaves a chance below LEAST_KNOWN that it is right
    to within a good part of itself. The least constant one goes first, and the others are asked again; the
    doubt is there where none is left. ``steady``: of a result's names; ``records``: of the estimation."""
    while result.choices:
        found = steady(result)
        asked = [(found[key], c) for c in result.choices if (key := _key(c)) in found and not _by_current(c)]
        one, choice = max(asked, key=lambda pair: pair[0].off, default=(None, None))
        if one is None or choice is None or _known(one):
            break
        effect = choice.chosen.effect
        why = (
            f"{effect.effect} is no constant of the joint: in {len(one.sizes)} stretches of the recordings "
            f"the torques want {min(one.sizes):.2g} to {max(one.sizes):.2g} times its size"
        )
        if len(result.choices) == 1:
            bare = replace(result.giving_up([choice], why), final=result.baseline, choices=())
            return replace(bare, last_round=(), nameless=None), Doubt(choice, why)
        result = left_out(result, choice, why, without(result, effect, records))
    return result, None


def _key(choice: Choice) -> tuple[str, str]:
    return choice.chosen.effect.effect, choice.chosen.effect.location


def _by_current(choice: Choice) -> bool:
    return choice.chosen.by_current > 0.0


def _known(one: Steadiness) -> bool:
    return chance_within(KNOWN, one.off) >= LEAST_KNOWN
