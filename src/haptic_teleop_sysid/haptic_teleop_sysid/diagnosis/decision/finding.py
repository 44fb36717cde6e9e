"""One finding in the terms of diagnosis.json: its parameters with their errors, and how sure it is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from haptic_teleop_sim.effects import EffectParameter
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit

from ..evidence.by_blocks import seen_steadily
from ..evidence.certainty import standard_errors
from ..hypotheses.candidates import goes_with
from ..policy import LEAST_KNOWN, SUREST
from .adequacy import NOT_SURE
from .search.decide import Choice
from .words import because

#: Relative error within which a size counts as known, and an order: half a cycle more or less in two is
#: another shape.
KNOWN, KNOWN_ORDER = 0.5, 0.25


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


def unsure_of_their_shape(
    choices: Sequence[Choice], final: Fit, spread: dict[str, float]
) -> tuple[Choice, ...]:
    """The choices, in which nobody is sure of a richer form of which a size is not known, or ended at the
    bound of what it may be: of that nobody knows the error."""
    told = []
    for choice in choices:
        plain = choice.chosen.effect.entry.refinement
        ended = _ended(choice.chosen.effect, final)
        if plain is not None and not choice.unsure and (ended or shape_unknown(choice, final, spread)):
            name = plain.of.replace("_", " ")
            why = f"its {ended} ended at a bound" if ended else "what makes it another form is not known"
            choice = replace(choice, unsure=f"it may be no more than {name}, because {why}")
        told.append(choice)
    return tuple(told)


def _ended(effect: Effect, final: Fit) -> str | None:
    """The first of an effect's sizes that ended at the bound of what it may be."""
    head = f"{effect.location}.{effect.effect}."
    sizes = (p.name for p in effect.entry.parameters if _is_size(p))
    return next((name for name in sizes if head + name in final.at_bound), None)


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
    return float(np.sqrt(std**2 + spread**2 + parameter.smeared**2 + (parameter.form * size) ** 2))
