"""A size, or a moment, at the end of what is possible says that the name stands for something else.

A load that changes before the recording has begun is the inertia's, which then is not known beside it; a gain
of which nothing is left after a minute is no amplifier's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.effects import EffectParameter
from haptic_teleop_sysid.estimation.records import Record

from .beside_the_others import left_out, without
from .decide import Choice
from .reasons import Doubt
from .search import SearchResult


def within_bounds(result: SearchResult, estimation: Sequence[Record]) -> tuple[SearchResult, Doubt | None]:
    """The result without names of which a size, or the moment at which they act, ends at a bound where it
    is not none, the last one first; and the doubt, where no name is left. What the currents or the second
    method show is not asked."""
    while result.choices:
        asked = ((c, _at_its_bound(result, c)) for c in reversed(result.choices))
        found = [(c, name) for c, name in asked if name is not None]
        if not found:
            break
        choice, name = found[0]
        effect = choice.chosen.effect
        why = (
            f"the {name.replace('_', ' ')} of {effect.effect} at {effect.location} would be at the end of "
            "what is possible, or beyond"
        )
        if len(result.choices) == 1:
            return result.without_names([choice], why), Doubt(choice, why)
        result = left_out(result, choice, why, without(result, effect, estimation))
    return result, None


def _at_its_bound(result: SearchResult, choice: Choice) -> str | None:
    """The name of a size or moment of a choice's effect that ended at a bound."""
    if choice.chosen.by_current > 0.0 or choice.chosen.witnessed is not None:
        return None
    effect, values = choice.chosen.effect, result.final.model.parameter_values()
    for parameter in effect.entry.parameters:
        name = f"{effect.location}.{effect.effect}.{parameter.name}"
        told = _says_that_it_is_there(parameter, values.get(name, 0.0), effect.entry.momentary)
        if name in result.final.at_bound and told:
            return parameter.name
    return None


def _says_that_it_is_there(parameter: EffectParameter, value: float, momentary: bool) -> bool:
    """Whether a parameter, with this value, says how much there is of an effect, or when it acts."""
    if parameter.default is not None:
        return False
    if parameter.neutral is None:
        return momentary and parameter.unit == "s"
    return np.isfinite(parameter.neutral) and not np.isclose(value, parameter.neutral, atol=1e-12)
