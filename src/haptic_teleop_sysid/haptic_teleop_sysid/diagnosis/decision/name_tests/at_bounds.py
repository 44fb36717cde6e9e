"""A size, or a moment, at the end of what is possible says that the name stands for something else.

A load that changes before the recording has begun is the inertia's, which then is not known beside it; a gain
of which nothing is left after a minute is no amplifier's.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.effects import EffectParameter
from haptic_teleop_sysid.estimation.records import Record

from ...hypotheses.material import material
from ..reasons import Doubt
from ..search.decide import Choice
from ..search.rounds import SearchResult
from .beside_the_others import left_out, without


def within_bounds(result: SearchResult, estimation: Sequence[Record]) -> tuple[SearchResult, Doubt | None]:
    """The result without names of which a size, or the moment at which they act, ends at a bound where it
    is not none, and those that, fitted beside the ones that are left, do not deserve their name any more (see
    `material`); the last one first; and the doubt, where no name is left. What the currents or the second
    method show is not asked."""
    while result.choices:
        asked = ((c, _against(result, c)) for c in reversed(result.choices))
        choice, why = next(((c, why) for c, why in asked if why is not None), (None, ""))
        if choice is None:
            break
        if len(result.choices) == 1:
            return result.without_names([choice], why), Doubt(choice, why)
        result = left_out(result, choice, why, without(result, choice.chosen.effect, estimation))
    return result, None


def _against(result: SearchResult, choice: Choice) -> str | None:
    """What speaks against a choice, None for nothing."""
    if choice.chosen.by_current > 0.0 or choice.chosen.grounds is not None:
        return None
    effect, final = choice.chosen.effect, result.final
    named = f"{effect.effect} at {effect.location}"
    for parameter in effect.entry.parameters:
        name = f"{effect.location}.{effect.effect}.{parameter.name}"
        value = final.model.parameter_values().get(name, 0.0)
        if name in final.at_bound and _says_that_it_is_there(parameter, value, effect.entry.momentary):
            what = parameter.name.replace("_", " ")
            return f"the {what} of {named} would be at the end of what is possible, or beyond"
    key = effect.effect, effect.location
    fitted = next((e for e in final.model.effects if (e.effect, e.location) == key), effect)
    if fitted != effect and not material(fitted, result.scales.driven(final.model)):
        return f"beside the others {named} is too small, or too near to an end of the recordings, to be told"
    return None


def _says_that_it_is_there(parameter: EffectParameter, value: float, momentary: bool) -> bool:
    """Whether a parameter, with this value, says how much there is of an effect, or when it acts."""
    if parameter.default is not None:
        return False
    if parameter.neutral is None:
        return momentary and parameter.unit == "s"
    return np.isfinite(parameter.neutral) and not np.isclose(value, parameter.neutral, atol=1e-12)
