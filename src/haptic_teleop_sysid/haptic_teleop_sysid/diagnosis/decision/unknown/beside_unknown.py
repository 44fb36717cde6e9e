"""Names that stand beside something unknown.

An `unknown` says that something is missing for which there is no name. What else is missing has one all the
same: friction of a robot that also sticks at some moments, or beside a delay that is no torque. So whatever
made the verdict, the names that explain most torque are asked whether they stand (`in_part`). Of physics
without a name there is always a name that resembles a part: one that stands must be most of what is missing,
or friction, which shows where the motion turns (`at_reversals`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.inverse_dynamics.searched_groups import Group, SearchedGroups
from ...evidence.second_method import SecondMethod
from ...hypotheses.candidates import family
from ...policy import LEAST_EXPLAINED
from ..reasons import Doubt
from ..search.rounds import SearchResult
from ..second_method.as_result import fit_of
from ..verdict import Verdict
from .at_reversals import Turning
from .in_part import InPart, found_in_part, found_one_by_one, where_the_rest_is, with_found
from .stand_in import StandIn

#: Share by which the size of a friction may differ from that of its jump.
OTHERWISE = 0.25


def with_names(
    verdict: Verdict,
    result: SearchResult,
    doubt: Doubt | None,
    instead: StandIn | None,
    second_method: SecondMethod | None,
    records: Sequence[Record],
    spread: Callable[[Model], dict[str, float]],
    turning: Turning,
) -> Verdict:
    """The `unknown` verdict with the names that stand beside it: those of the stand-in where all that speaks
    against them is that they explain too little, else, or where none of them stands, those of `leading`;
    ``result``: with its baseline, ``records``: of the estimation, ``spread``: by how much sizes of a model's
    effects differ (see `verdict.finding`), ``turning``: what shows where the motion turns."""
    if second_method is None:
        return verdict
    if instead is not None and doubt is not None and doubt.short:
        parts = most_or_seen(found_in_part(instead, result.baseline.model, second_method), turning)
        if parts:
            verdict = with_found(verdict, parts, instead.fit, len(instead.effects), spread(instead.fit.model))
            return where_the_rest_is(verdict, parts)
    named: list[tuple[Group, InPart]] = []
    for group in leading(second_method.searched):
        named += [(group, one) for one in most_or_seen(found_one_by_one(group, second_method), turning)]
    told = ((f["effect"], f["location"]) for f in verdict.findings)
    taken = {(name, location) for effect, location in told for name in family(effect)}
    for group, one in sorted(named, key=lambda pair: -pair[1].share):
        # Of forms of one thing at one place one is enough.
        if (one.effect.effect, one.effect.location) in taken:
            continue
        # Nor is what one may be told again.
        others = tuple((e, p) for e, p in one.others if (e.effect, e.location) not in taken)
        may_be = (one.effect, *(e for e, _ in others))
        taken |= {(name, e.location) for e in may_be for name in family(e.effect)}
        one = replace(one, others=others)
        fit = fit_of(group, result.baseline, records)
        verdict = with_found(verdict, [one], fit, len(group.effects), spread(fit.model))
    return verdict


def most_or_seen(parts: Sequence[InPart], turning: Turning) -> list[InPart]:
    """Those that explain at least LEAST_EXPLAINED of all that is missing, or are of a kind that jumps where
    the motion turns: seen there with that size, or not asked, because it turns too seldom (of a motion that
    never turns it is no more than a constant, which must explain that share). Who should be seen there and is
    not, falls. Who is seen with another size is told from there (`with_friction`): along the motion it also
    stands in for what has no name."""
    kept = []
    for part in parts:
        effect, location = part.effect.effect, part.effect.location
        jumps = not part.everywhere and any(e.jumps and effect in family(n) for n, e in EFFECTS.items())
        there = turning.size_of(effect, location)
        size = part.effect.values[part.effect.entry.parameters[0].name]
        agrees = there is None or abs(size - there) <= OTHERWISE * max(size, there)
        if ((jumps and agrees) or part.share >= LEAST_EXPLAINED) and not turning.not_seen(effect, location):
            kept.append(part)
    return kept


def leading(searched: SearchedGroups) -> list[Group]:
    """The group of each number of effects that gains most, where it gains anything."""
    best = (max(level, key=lambda group: group.gain) for level in searched.levels if level)
    return [group for group in best if group.gain > 0.0]
