"""What is surely found beside something that has no name.

A name explains little where much else is missing: friction of a drive whose link bends in a way that is no
spring's. Judged together with the nearest name of the rest it falls with that. Here each name is judged
beside a torque without a form, in quantities that are not its own, that takes on the rest whatever its law
(a partly linear model: Robinson, Econometrica 56(4), 1988). The verdict stays `unknown`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from haptic_teleop_sim.model import Effect, Model

from ..evidence.inverse_dynamics.groups import CLEARLY, Search
from ..evidence.inverse_dynamics.latent import Latent
from ..evidence.inverse_dynamics.terms import Hypothesis, follows_from_motion
from ..evidence.second_opinion import Opinion
from ..policy import LEAST_EXPLAINED
from .adequacy import NOT_SURE
from .decide import Choice
from .doubt import OTHER_SIZE
from .reasons import Doubt
from .stand_in import StandIn
from .verdict import Verdict, finding

#: Relative difference between the sizes of torques and of free runs that is told.
_TOLD = 0.1


@dataclass(frozen=True)
class InPart:
    """A name that stands: ``effect`` with the sizes found here and their standard errors ``std`` by parameter
    (what halves of the stretches and free runs of the stand-in put them apart); ``index`` among the
    stand-in's effects, and its ``freely`` found sizes; ``adequacy``: share that it explains of what any
    torque in its own quantities does; ``share``: of all that is missing; ``rest``: the torque without a form
    beside which it was judged, which explains ``more`` of all that is missing."""

    effect: Effect
    std: dict[str, float]
    index: int
    freely: dict[str, float]
    adequacy: float
    share: float
    rest: Latent
    more: float

    def told(self) -> str:
        """What speaks for it, in words."""
        values = self.effect.values
        others = ", ".join(
            f"{n} {v:.3g}" for n, v in self.freely.items() if abs(v - values[n]) > _TOLD * abs(values[n])
        )
        return (
            f"beside a torque without a form that follows {' and '.join(self.rest.quantities)} at "
            f"{self.rest.location}, "
            f"it explains {100 * self.share:.0f} % of the torque that is missing on recordings that were not "
            f"fitted, and {100 * self.adequacy:.0f} % of what any torque in its own quantities does; what "
            "that other torque is has no name"
            + (f"; free runs of the stand-in want {others}" if others else "")
        )


def found_in_part(instead: StandIn, model: Model, opinion: Opinion) -> list[InPart]:
    """The names of a stand-in that are surely there, the one that explains most first; ``model``: the
    structure; the inverse dynamics of every other stretch of all recordings judge."""
    search = opinion.witness.folds
    tried = () if opinion.chosen is None else opinion.chosen.group.hypotheses
    known = {(h.entry.name, h.location): h for h in tried}
    found = []
    for index, effect in enumerate(instead.effects):
        if not follows_from_motion(effect.entry):
            continue
        own = known.get((effect.effect, effect.location))
        own = Hypothesis.of(effect, model.place(effect.location)) if own is None else own
        if (one := _judged(index, effect, own, search)) is not None:
            found.append(one)
    return sorted(found, key=lambda one: -one.share)


def _judged(index: int, effect: Effect, own: Hypothesis, search: Search) -> InPart | None:
    alike = search.alike(own)
    others = [q for q in search.latents if q not in alike and "time" not in q.quantities]
    if not alike or not others:
        return None
    rest = min(others, key=lambda q: search.left_over((own, q)))
    both = (own, rest)
    if search.likelier(both) < search.likelier((rest,)) + CLEARLY:
        return None
    # Along one quantity a curve that explains clearly more has another form.
    curves = [(q, rest) for q in alike if len(q.quantities) == 1]
    if any(search.likelier(curve) > search.likelier(both) + CLEARLY for curve in curves):
        return None
    adequacy = search.adequacy_beside(own, (rest,))
    sizes = _sizes(own, both, search)
    if adequacy < LEAST_EXPLAINED or sizes is None:
        return None
    mean = {n: 0.5 * (one + other) for n, (one, other) in sizes.items()}
    freely = {n: effect.values[n] for n in sizes}
    # Half the squared difference is the variance of either; the mean of two has half of that.
    std = {
        n: math.hypot(0.5 * (one - other), (mean[n] - freely[n]) / math.sqrt(2.0))
        for n, (one, other) in sizes.items()
    }
    share, more = (search.explained(both) - search.explained((one,)) for one in (rest, own))
    named = replace(effect, parameters={**effect.parameters, **mean})
    return InPart(named, std, index, freely, adequacy, share, rest, more)


def _sizes(
    own: Hypothesis, both: tuple[Hypothesis, Latent], search: Search
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
    verdict: Verdict,
    found: Sequence[InPart],
    instead: StandIn,
    doubt: Doubt,
    spread: dict[str, float],
) -> Verdict:
    """An `unknown` verdict with what was found in part, and the rest as where and what is missing; no name in
    it is sure."""
    if not found or doubt.choice is None:
        return verdict
    model = instead.fit.model
    findings = []
    for one in found:
        index = len(model.effects) - len(instead.effects) + one.index
        effects = (*model.effects[:index], one.effect, *model.effects[index + 1 :])
        fit = replace(instead.fit, model=replace(model, effects=effects))
        head = f"{one.effect.location}.{one.effect.effect}."
        std = {head + n: e for n, e in one.std.items()}
        told = one.told()
        explanation = replace(
            doubt.choice.chosen, fit=fit, effect_index=index, std=std, by_current=0.0, witnessed=told
        )
        findings.append(finding(Choice(explanation, one.adequacy), fit, spread, NOT_SURE))
    rest = found[0].rest
    where: dict[str, Any] = {
        "equation": rest.location,
        "share": round(found[0].more, 3),
        "condition": " and ".join(rest.quantities),
        "intervals": [],
    }
    return replace(verdict, findings=findings, where=[where])
