"""The verdict on a search, in the contract's terms."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from haptic_teleop_sim.effects import EffectParameter, effect_entry
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.by_blocks import seen_steadily
from ..evidence.certainty import standard_errors
from ..evidence.residual import Condition, conditions, intervals, shares
from ..hypotheses.candidates import goes_with
from ..policy import LEAST_EXPLAINED, LEAST_KNOWN, NOTICEABLE, STRUCTURED, SUREST
from .adequacy import NOT_SURE, Adequacy, explained_torque
from .corroborated import adds_torque
from .decide import Choice
from .reasons import Doubt
from .search import SearchResult
from .words import because

#: Share of the left-over torque that a curve explains, from which the place of something unknown is told with
#: what it follows.
FOLLOWS = 0.2
#: Share of its size by which an effect is off because its form is never quite that of a machine's, as
#: measured on development recordings whose generator has another form for everything.
FORM = 0.03
#: Relative error within which a size counts as known, and an order: half a cycle more or less in two is
#: another shape.
KNOWN, KNOWN_ORDER = 0.5, 0.25


@dataclass(frozen=True)
class Verdict:
    """``kind``: identified | ambiguous | unknown | no_mismatch; ``where``, ``findings``: as in the contract;
    ``remaining``: what the left-over torque still depends on, strongest first; ``before``: the same of the
    baseline; ``adequacy``: how much of what is missing the findings explain, None where none was asked."""

    kind: str
    where: list[dict[str, Any]]
    findings: list[dict[str, Any]]
    remaining: list[Condition]
    before: list[Condition]
    adequacy: Adequacy | None = None


def decide_verdict(
    result: SearchResult,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    doubt: Doubt | None = None,
    spread: dict[str, float] | None = None,
    adequate: Adequacy | None = None,
) -> Verdict:
    """The verdict on a search; ``doubt``: what speaks against the names found, or for something unnamed;
    ``spread``: by what parameters differ between recordings (`Stand`) and forms of a law; ``adequate``: how
    much of what is missing the findings explain, None where that was not asked."""
    joint = result.baseline.model.joint
    before = conditions(result.baseline, estimation, validation, joint)
    remaining = conditions(result.final, estimation, validation, joint) if result.choices else before
    surest = SUREST if adequate is None else adequate.surest
    own = result.baseline.model
    findings = [finding(c, result.final, spread or {}, surest, own) for c in result.choices]
    unexplained = structured(result.final, remaining, estimation, result)
    if result.choices and adequate is not None and (adequate.much_is_left or adequate.worse):
        # Beside something unknown an error of an encoder has to show in free runs; a torque has the torques.
        beside = [
            f
            for c, f in zip(result.choices, findings, strict=True)
            if f["confidence"] > 0.0 or adds_torque(c.chosen.effect)
        ]
        left = [where_left(result, remaining, estimation)]
        if adequate.follows is not None:
            left[0] |= {"equation": adequate.follows.equation, "condition": adequate.follows.quantity}
        where = left if adequate.much_is_left else _where(result, before, estimation, None)
        return Verdict("unknown", where, beside, remaining, before, adequate)
    if result.choices:
        kind = "ambiguous" if any(c.ambiguous for c in result.choices) else "identified"
    else:
        kind = "unknown" if unexplained is not None or doubt is not None else "no_mismatch"
    where = _where(result, before, estimation, unexplained if kind == "unknown" else None)
    if doubt is not None and not where:
        where = [_doubtful_place(doubt, result, before, estimation)]
    return Verdict(kind, where, findings, remaining, before, adequate)


def structured(
    fit: Fit, found: Sequence[Condition], records: Sequence[Record], result: SearchResult
) -> Condition | None:
    """What the left-over torque noticeably depends on, or None."""
    if not found or found[0].explained < STRUCTURED:
        return None
    best = found[0]
    return best if best.size > NOTICEABLE * result.scales.size["torque"] else None


def finding(
    choice: Choice, final: Fit, spread: dict[str, float], surest: float = SUREST, own: Model | None = None
) -> dict[str, Any]:
    """One finding, with the numbers of the final model; its standard errors are those of the fit with the
    spread between recordings and forms.  ``surest``: the most that its confidence may be, as far as it is
    seen in the motion; ``own``: the user's model: what that has goes with no finding."""
    effect = choice.chosen.effect
    beside = goes_with(effect, final.model) if own is None or goes_with(effect, own) is None else None
    fitted = _fitted(choice, final)
    parameters = _parameters(choice, final, spread)
    steady = 1.0
    if choice.chosen.by_current > 0.0:
        surest = SUREST
    else:
        steady = _seen_steadily(choice)
    if choice.unsure:
        surest = min(surest, NOT_SURE)
    sure = min(choice.confidence, size_known(fitted, parameters), surest)
    told = min(sure, steady)
    return {
        "effect": effect.effect,
        "location": effect.location,
        "parameters": parameters,
        "confidence": round(told, 4),
        "alternatives": [
            {"effect": e.effect.effect, "location": e.effect.location, "confidence": round(min(p, told), 4)}
            for e, p in choice.others
        ],
        "because": because(
            choice,
            fitted,
            steadily=steady >= sure,
            surest=told,
            beside=beside,
        ),
    }


def _seen_steadily(choice: Choice) -> float:
    """The chance that other recordings speak for the finding, too."""
    chosen = choice.chosen
    gain = chosen.gain + chosen.held_out + chosen.reconciled
    return seen_steadily(gain, chosen.gains)


def size_unknown(choice: Choice, final: Fit, spread: dict[str, float]) -> bool:
    """Whether a finding's sizes are so badly known that it might as well not be there (see `size_known`)."""
    return size_known(_fitted(choice, final), _parameters(choice, final, spread)) < LEAST_KNOWN


def shape_unknown(choice: Choice, final: Fit, spread: dict[str, float]) -> bool:
    """Whether one of a finding's sizes may be anything up to half of the largest: a dry friction that falls
    with speed, nobody knows to what, is no more than dry friction."""
    told = _parameters(choice, final, spread)
    sizes = [told[p.name] for p in choice.chosen.effect.entry.parameters if p.name in told and _is_size(p)]
    largest = max((abs(size["value"]) for size in sizes), default=0.0)
    return any(size["std"] > KNOWN * largest for size in sizes)


def _is_size(parameter: EffectParameter) -> bool:
    return parameter.default is None and parameter.neutral == 0.0


def _fitted(choice: Choice, final: Fit) -> Effect:
    """The finding's effect with the numbers of the final model."""
    effect = choice.chosen.effect
    own = (e for e in final.model.effects if (e.effect, e.location) == (effect.effect, effect.location))
    return next(own, effect)


def _parameters(choice: Choice, final: Fit, spread: dict[str, float]) -> dict[str, dict[str, Any]]:
    """Value, standard error and unit of the finding's parameters that are told."""
    fitted = _fitted(choice, final)
    std = standard_errors(final) | choice.chosen.std
    head = f"{fitted.location}.{fitted.effect}."
    return {
        name: {
            "value": float(value),
            "std": _uncertainty(
                fitted.entry.parameter(name), value, std.get(head + name, 0.0), spread.get(head + name, 0.0)
            ),
            "unit": fitted.entry.parameter(name).unit,
        }
        for name, value in fitted.parameters.items()
        if fitted.entry.parameter(name).reported(value)
    }


def size_known(effect: Effect, parameters: Mapping[str, Mapping[str, Any]]) -> float:
    """Chance (0 to 1) that a size of the effect is right to within KNOWN of itself, the surest one's, and
    its order to within KNOWN_ORDER: nobody is surer of a name than of there being that much of it, and of
    that shape. ``parameters``: each with ``value`` and ``std``; 1 for an effect without a size."""
    sizes, orders = [], []
    for p in effect.entry.parameters:
        if p.name not in parameters:
            continue
        value, error = parameters[p.name]["value"], parameters[p.name]["std"]
        if p.scan == "order":
            orders.append(chance_within(KNOWN_ORDER * abs(value), error))
        elif p.default is None and p.neutral is not None:
            # The inverse of a limit has the same relative error, and is none where there is no limit.
            size = value - p.neutral if math.isfinite(p.neutral) else value
            sizes.append(chance_within(KNOWN * abs(size), error))
    return min([max(sizes, default=1.0), *orders])


def chance_within(distance: float, std: float) -> float:
    """Chance (0 to 1) that something with this standard error is off by no more than a distance."""
    return math.erf(distance / max(std, 1e-300) / math.sqrt(2.0))


def _uncertainty(parameter: EffectParameter, value: float, std: float, spread: float) -> float:
    """Standard error with the spread between recordings, what the equation smears and, for a size, what the
    effect's form is off by."""
    none = parameter.neutral
    size = 0.0 if none is None else abs(value - none) if np.isfinite(none) else abs(value)
    return float(np.sqrt(std**2 + spread**2 + parameter.smeared**2 + (FORM * size) ** 2))


def _where(
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


def _doubtful_place(
    doubt: Doubt, result: SearchResult, before: Sequence[Condition], estimation: Sequence[Record]
) -> dict[str, Any]:
    """Where the unnamed physics sits: where the doubt says; at the place of the name that was given up, if
    that explains most of what is missing; else where most of the torque acts that the observer adds."""
    model = result.baseline.model
    place, share = _largest(result.baseline, estimation)
    condition = followed(before)
    if doubt.place is not None:
        place, condition = doubt.place, "time"
    elif doubt.choice is not None:
        effect, fit = doubt.choice.chosen.effect, doubt.choice.chosen.fit
        if effect.location == place or explained_torque(result.baseline, fit, estimation) > LEAST_EXPLAINED:
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
