"""What is surely found beside something that has no name.

A name explains little where much else is missing: friction of a drive whose link bends in a way that is no
spring's. Judged together with the nearest name of the rest it falls with that. Here each name is judged
beside a free curve, in quantities that are not its own, that takes on the rest whatever its law
(a partly linear model: Robinson, Econometrica 56(4), 1988); by itself where each of these could be its own,
as on one slow sine. The verdict stays `unknown`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit

from ...evidence.inverse_dynamics.groups import CLEARLY, Search
from ...evidence.inverse_dynamics.latent import Latent
from ...evidence.inverse_dynamics.searched_groups import Group, SearchedGroups
from ...evidence.inverse_dynamics.terms import Hypothesis
from ...evidence.second_method import APART, NEGLIGIBLE, SecondMethod
from ...hypotheses.explanation import Explanation
from ...hypotheses.follows import follows_from_motion
from ...policy import LEAST_EXPLAINED, NEARLY_ALL
from ..adequacy import NOT_SURE
from ..finding import finding
from ..name_tests.objections import OTHER_SIZE
from ..search.decide import LEAST_TOLD, Choice
from ..verdict import Verdict
from .stand_in import StandIn

#: Relative difference between the sizes of torques and of free runs that is told.
_TOLD = 0.1
#: Where a size comes from that is another one.
FREELY, ALONE = "free runs with the names alone want", "fitted without that torque it would be"


@dataclass(frozen=True)
class InPart:
    """A name that stands: ``effect`` with the sizes found here and their standard errors ``std`` by parameter
    (what halves of the stretches, and the sizes found elsewhere, put them apart); ``index`` among the effects
    of which it is one; ``apart``: the sizes found elsewhere, and ``words`` for that; ``adequacy``: share that
    it explains of what any torque in its own quantities does, or, where it is the same ``everywhere``, any at
    its place; ``share``: of all that is missing; ``rest``: the free curve beside which it was
    judged, which explains ``more`` of all that is missing; None where each such torque could be the name's,
    too; ``others``: what the torques do not tell it from, with their shares; ``known``: its own share."""

    effect: Effect
    std: dict[str, float]
    index: int
    apart: dict[str, float]
    words: str
    adequacy: float
    share: float
    rest: Latent | None
    more: float
    everywhere: bool = False
    others: tuple[tuple[Effect, float], ...] = ()
    known: float = 1.0

    def told(self) -> str:
        """What speaks for it, in words."""
        values = self.effect.values
        others = ", ".join(
            f"{n} {v:.3g}" for n, v in self.apart.items() if abs(v - values[n]) > _TOLD * abs(values[n])
        )
        beside, rest = "", "what the rest is has no name"
        if self.rest is not None:
            follows = " and ".join(self.rest.quantities)
            beside = f"beside a free curve that follows {follows} at {self.rest.location}, "
            rest = "what that other torque is has no name"
        return (
            f"{beside}it explains {100 * self.share:.0f} % of the torque that is missing on recordings that "
            f"were not fitted, and {100 * self.adequacy:.0f} % of what any free curve that could "
            f"be it does; {rest}" + (f"; {self.words} {others}" if others else "")
        )


def found_in_part(instead: StandIn, model: Model, second_method: SecondMethod) -> list[InPart]:
    """The names of a stand-in that are surely there, the one that explains most first; ``model``: the
    structure; the inverse dynamics of every other stretch of all recordings judge."""
    tried = () if second_method.chosen is None else second_method.chosen.group.hypotheses
    known = {(h.entry.name, h.location): h for h in tried}

    def hypothesis(effect: Effect) -> Hypothesis:
        own = known.get((effect.effect, effect.location))
        return Hypothesis.of(effect, model.place(effect.location)) if own is None else own

    return _those_that_stand(instead.effects, hypothesis, second_method.searched.folds, FREELY, alone=False)


def found_one_by_one(group: Group, second_method: SecondMethod) -> list[InPart]:
    """The same of the names of a group of the inverse dynamics, which were not run freely; and what else each
    may be, where that gains nearly as much in its place."""
    own = dict(zip(_names(group), group.hypotheses, strict=True))
    found = _those_that_stand(
        group.effects, lambda e: own[e.effect, e.location], second_method.searched.folds, ALONE, alone=True
    )
    return [_with_rivals(one, group, second_method.searched) for one in found]


def _with_rivals(one: InPart, group: Group, searched: SearchedGroups) -> InPart:
    """A name of a group with what it is not told from: an effect in its place, by which the torques gain less
    by no more than NEGLIGIBLE times APART. A richer form of it is none, because it contains it."""
    name = one.effect.effect, one.effect.location
    rest = set(_names(group)) - {name}
    near: dict[tuple[str, str], tuple[Effect, float]] = {}
    for other in itertools.chain.from_iterable(searched.levels):
        behind = (group.gain - other.gain) / APART
        instead = [e for e in other.effects if (e.effect, e.location) not in rest]
        if len(other.effects) != len(group.effects) or len(instead) != 1 or behind > NEGLIGIBLE:
            continue
        (effect,) = instead
        key, weight, richer = (effect.effect, effect.location), math.exp(-behind), effect.entry.refinement
        contains = richer is not None and (richer.of, effect.location) == name
        if key != name and not contains and weight > near.get(key, (effect, 0.0))[1]:
            near[key] = effect, weight
    whole = 1.0 + sum(weight for _, weight in near.values())
    shares = sorted(((e, weight / whole) for e, weight in near.values()), key=lambda rival: -rival[1])
    others = tuple((e, one.adequacy * share) for e, share in shares if share > LEAST_TOLD)
    return replace(one, others=others, known=1.0 / whole)


def _names(group: Group) -> list[tuple[str, str]]:
    return [(e.effect, e.location) for e in group.effects]


def _those_that_stand(
    effects: Sequence[Effect],
    hypothesis: Callable[[Effect], Hypothesis],
    search: Search,
    words: str,
    alone: bool,
) -> list[InPart]:
    """The effects that stand; ``alone``: those that are the same everywhere, too, which need their rivals."""
    found = []
    for index, effect in enumerate(effects):
        if follows_from_motion(effect.entry):
            one = _judged(index, effect, hypothesis(effect), search, words, alone)
            if one is not None:
                found.append(one)
    return sorted(found, key=lambda one: -one.share)


def _judged(
    index: int, effect: Effect, own: Hypothesis, search: Search, words: str, alone: bool
) -> InPart | None:
    alike = search.alike(own)
    others = [q for q in search.latents if q not in alike and "time" not in q.quantities]
    here = [q for q in others if q.place == own.place]
    everywhere = alone and bool(here) and search.same_everywhere(own)
    if not alike and not everywhere:
        return None
    # On a motion as plain as one sine each of them could be this torque, and each at its place holds a
    # constant: then the name is judged by itself.
    rest = None if everywhere else min(others, key=lambda q: search.left_over((own, q)), default=None)
    beside = () if rest is None else (rest,)
    both = (own, *beside)
    if search.likelier(both) < search.likelier(beside) + CLEARLY:
        return None
    adequacy = _of_all_torques(own, here, search) if everywhere else search.adequacy_beside(own, beside)
    # Along one quantity a curve that explains clearly more has another form, unless the effect does nearly
    # all that it does: in a long recording the least difference is clear.
    curves = [(q, *beside) for q in alike if len(q.quantities) == 1]
    other_form = any(search.likelier(curve) > search.likelier(both) + CLEARLY for curve in curves)
    sizes = _sizes(own, both, search)
    if adequacy < (NEARLY_ALL if other_form else LEAST_EXPLAINED) or sizes is None:
        return None
    mean = {n: 0.5 * (one + other) for n, (one, other) in sizes.items()}
    apart = {n: effect.values[n] for n in sizes}
    # Half the squared difference is the variance of either; the mean of two has half of that.
    std = {
        n: math.hypot(0.5 * (one - other), (mean[n] - apart[n]) / math.sqrt(2.0))
        for n, (one, other) in sizes.items()
    }
    share, more = (
        search.explained(both) - max(search.explained(known), 0.0) for known in (beside, (own,))
    )
    named = replace(effect, parameters={**effect.parameters, **mean})
    return InPart(named, std, index, apart, words, adequacy, share, rest, more, everywhere)


def _of_all_torques(own: Hypothesis, here: Sequence[Latent], search: Search) -> float:
    """Share of what any free curve explains at a constant's place that the constant does."""
    most = max(search.explained((q,)) for q in here)
    return min(max(search.explained((own,)), 0.0) / most, 1.0) if most > 0.0 else 1.0


def _sizes(
    own: Hypothesis, both: tuple[Hypothesis | Latent, ...], search: Search
) -> dict[str, tuple[float, ...]] | None:
    """The effect's sizes that either half of the stretches wants, the rest taken on; None where they are not
    the same, or where one is at the bound of what was tried."""
    low, high = own.bounds()
    first = len(search.sides[0].side.names)
    halves = []
    for number, side in enumerate(search.sides):
        values = search.fitted(number, both)
        factors = values[first : first + len(low)]
        if any(min(f - a, b - f) <= 0.0 for f, a, b in zip(factors, low, high, strict=True)):
            return None
        scale = side.side.arm_scale(values) if own.place == "arm" else 1.0
        halves.append(own.effect(scale * factors).values)
    found = {n: tuple(half[n] for half in halves) for n in own.sizes}
    steady = all(abs(a - b) <= OTHER_SIZE * max(abs(a), abs(b)) for a, b in found.values())
    return found if steady else None


def with_found(
    verdict: Verdict, found: Sequence[InPart], fit: Fit, count: int, spread: dict[str, float]
) -> Verdict:
    """An `unknown` verdict with what was found in part among the last ``count`` effects of a fit; no name in
    it is sure."""
    model = fit.model
    told = {(f["effect"], f["location"]) for f in verdict.findings}
    findings = []
    for one in found:
        if (one.effect.effect, one.effect.location) in told:
            continue
        index = len(model.effects) - count + one.index
        effects = (*model.effects[:index], one.effect, *model.effects[index + 1 :])
        with_it = replace(fit, model=replace(model, effects=effects))
        head = f"{one.effect.location}.{one.effect.effect}."
        std = {head + n: e for n, e in one.std.items()}
        explanation = Explanation(with_it, 0.0, 0.0, True, index, std=std, grounds=one.told())
        others = tuple((_in_its_place(explanation, e), share) for e, share in one.others)
        choice = Choice(explanation, one.adequacy * one.known, others)
        findings.append(finding(choice, with_it, spread, NOT_SURE))
    return replace(verdict, findings=[*verdict.findings, *findings]) if findings else verdict


def _in_its_place(explanation: Explanation, other: Effect) -> Explanation:
    """The explanation with another effect for its own."""
    model, index = explanation.fit.model, explanation.effect_index
    effects = (*model.effects[:index], other, *model.effects[index + 1 :])
    return replace(explanation, fit=replace(explanation.fit, model=replace(model, effects=effects)))


def where_the_rest_is(verdict: Verdict, found: Sequence[InPart]) -> Verdict:
    """The verdict with where the torque is beside which the names stand, and what it follows, where it says
    anything of that: unchanged where it predicts nothing."""
    one = next((one for one in found if one.rest is not None), None)
    if one is None or one.rest is None or one.more <= 0.0:
        return verdict
    rest = one.rest
    where: dict[str, Any] = {
        "equation": rest.location,
        "share": round(one.more, 3),
        "condition": " and ".join(rest.quantities),
        "intervals": [],
    }
    return replace(verdict, where=[where])
