"""Names of the inverse dynamics that explain nearly all, where no other ones are left."""

from __future__ import annotations

from dataclasses import replace

from .believed import Believed
from .decision.corroborated import adds_torque
from .decision.finding import unsure_of_their_shape
from .decision.name_tests.place import misplaced
from .decision.second_method.as_result import as_result
from .decision.second_method.nearly_all_torque import nearly_all_torque
from .evidence.other_forms import together
from .examined import Examined, forms_of
from .question import adequacy_of


def nearly_all(belief: Believed, left: Examined) -> Examined:
    """The names that explain nearly all the torque (see `nearly_all_torque`), where torques were given up or
    explain too little; else what was ``left``. Not where the doubt is about the recordings or says a place,
    where a sensor or the measured current has a name, or where parity equations or the user's own model speak
    against the new ones. What made the doubt is told with them."""
    found, second_method = belief.found, belief.found.second_method
    if second_method is None or not _asked(left):
        return left
    bases = (found.given, left.result.baseline.model)
    chosen = nearly_all_torque(
        second_method.searched, found.horizons.errors, [found.horizons.errors(model) for model in bases]
    )
    if chosen is None:
        return left
    told = "few names of the inverse dynamics explain nearly all the torque"
    bare = left.result.giving_up(left.result.choices, told)
    named, doubt = as_result(chosen, bare, found.learn, found.errors, found.simulated)
    if doubt is not None:
        return left
    if left.acting is not None and misplaced(named, left.acting, found.learn)[0] is not named:
        return left
    adequate = replace(adequacy_of(found, named), nearly_all_torque=True)
    if adequate.worse:
        return left
    forms = forms_of(found, named)
    unsure = "predictions of the next sample ask for more"
    if left.doubt is not None:
        unsure += f": {left.doubt.why}"
    spread = together(belief.stand.spread, forms)
    choices = tuple(replace(c, unsure=c.unsure or unsure) for c in named.choices)
    choices = unsure_of_their_shape(choices, named.final, spread)
    result = replace(named, choices=choices)
    return replace(left, result=result, doubt=None, away=None, adequate=adequate, forms=forms)


def _asked(left: Examined) -> bool:
    """Whether the answer would be `unknown` for what speaks against names of torques."""
    choices, doubt = left.result.choices, left.doubt
    if choices:
        torques = all(adds_torque(c.chosen.effect) and c.chosen.by_current <= 0.0 for c in choices)
        return torques and left.adequate is not None and left.adequate.much_is_left
    return doubt is not None and doubt.place is None and doubt.choice is not None
