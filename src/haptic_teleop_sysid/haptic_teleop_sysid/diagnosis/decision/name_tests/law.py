"""Is the law of a name that of the joint, or does it only come near to it?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sysid.estimation.records import Record

from ...evidence.held_out import with_both_kinds
from ...evidence.lack_of_fit import lack_of_fit
from ...hypotheses.follows import own_variable
from ...policy import ANOTHER_LAW, ANOTHER_LAW_DRY, LEAST_GAIN, NOT_QUITE, NOT_QUITE_DRY
from ..adequacy import Followed
from ..reasons import Doubt
from ..search.decide import Choice
from ..search.rounds import SearchResult
from .beside_the_others import left_out, without

#: What a torque over a variable of a map follows, in words.
_FOLLOWS = {
    "angle": "{place} angle",
    "velocity": "{place} velocity",
    "deflection": "deflection",
    "deflection_rate": "rate of deflection",
    "input": "input torque",
}


def by_its_law(
    result: SearchResult, estimation: Sequence[Record], validation: Sequence[Record]
) -> tuple[SearchResult, Doubt | None, Followed | None]:
    """The result without names beside which a curve over their own quantity gains so much that the law is
    another one (`_limits`, of what the name gains, as amplitudes), the worst one first, and in which nobody
    is sure of one beside which it gains less, but clearly; the doubt, where none is left, and
    what the torque of one that was given up follows, where others are. What the currents or the second
    method show is not asked: their sizes are not those by which innovations are smallest."""
    followed: Followed | None = None
    while result.choices:
        shares = _shares(result, estimation, validation)
        another = [k for k in shares if shares[k] >= _limits(result.choices[k])[1]]
        worst = max(another, key=lambda one: shares[one], default=None)
        if worst is None:
            return _nobody_sure(result, shares), None, followed
        choice = result.choices[worst]
        effect = choice.chosen.effect
        own = own_variable(result.final.model, effect)
        assert own is not None
        words = _FOLLOWS[own[0]].format(place=own[1])
        why = (
            f"the law of {effect.effect} at {effect.location} is not the joint's: a curve over the {words} "
            f"beside it gains {_times(shares[worst])} what it gains itself"
        )
        if len(result.choices) == 1:
            return result.without_names([choice], why), Doubt(choice, why), None
        followed = followed or Followed(effect.location, words)
        result = left_out(result, choice, why, without(result, effect, estimation))
    return result, None, followed


def _shares(
    result: SearchResult, estimation: Sequence[Record], validation: Sequence[Record]
) -> dict[int, float]:
    """What the curve beside each choice gains, as a share of what the choice gains, in amplitudes; only what
    is no chance."""
    fit, found = result.final, dict[int, float]()
    asked = [k for k, c in enumerate(result.choices) if _asked(result, c)]
    if not asked:
        return found
    both = with_both_kinds(fit, estimation, validation)
    for k in asked:
        chosen = result.choices[k].chosen
        gain = lack_of_fit(both, chosen.effect)
        own = max(chosen.gain + chosen.elsewhere, 1.0)
        if gain is not None and gain > LEAST_GAIN:
            found[k] = math.sqrt(gain / own)
    return found


def _asked(result: SearchResult, choice: Choice) -> bool:
    chosen = choice.chosen
    if chosen.by_current > 0.0 or chosen.grounds is not None:
        return False
    return own_variable(result.final.model, chosen.effect) is not None


def _limits(choice: Choice) -> tuple[float, float]:
    """From which shares nobody is sure of a choice, and its law is not the joint's."""
    dry = choice.chosen.effect.entry.memory
    return (NOT_QUITE_DRY, ANOTHER_LAW_DRY) if dry else (NOT_QUITE, ANOTHER_LAW)


def _times(share: float) -> str:
    """How much a share of amplitudes is of a gain, in words."""
    gain = share**2
    return f"{100 * gain:.0f} % of" if gain < 1.0 else f"{gain:.1f} times"


def _nobody_sure(result: SearchResult, shares: dict[int, float]) -> SearchResult:
    choices = list(result.choices)
    for k, share in shares.items():
        effect = choices[k].chosen.effect
        if choices[k].unsure or share < _limits(choices[k])[0]:
            continue
        name = effect.effect.replace("_", " ")
        unsure = (
            f"its law is not quite that of the joint: a curve over the same quantity beside the {name} gains "
            f"{_times(share)} what it gains itself"
        )
        choices[k] = replace(choices[k], unsure=unsure)
    return replace(result, choices=tuple(choices))
