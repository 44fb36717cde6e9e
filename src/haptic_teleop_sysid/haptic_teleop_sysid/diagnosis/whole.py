"""Names of the inverse dynamics that explain nearly all, where no other ones are left."""

from __future__ import annotations

from dataclasses import replace

from .believed import Believed
from .decision.misplaced import misplaced
from .decision.nearly_whole import nearly_whole
from .decision.opinion_as_result import as_result
from .evidence.other_forms import spread_by_form, together
from .evidence.steadiness import spread_by_stretch
from .examined import Examined
from .question import adequacy_of, steady


def whole(belief: Believed, left: Examined) -> Examined:
    """The names that explain nearly all the torque (see `nearly_whole`), where an answer would be `unknown`;
    else what was ``left``."""
    found, result, adequate = belief.found, left.result, left.adequate
    if result.choices:
        unknown = adequate is not None and adequate.much_is_left
    else:
        unknown = left.doubt is not None and left.doubt.place is None
    if not unknown or found.opinion is None:
        return left
    errors = found.horizons.errors
    before = min(map(errors, (found.given, result.baseline.model)))
    opinion = nearly_whole(found.opinion.witness, errors, before)
    if opinion is None:
        return left
    bare = result.giving_up(result.choices, "few names of the inverse dynamics explain nearly all the torque")
    named, doubt = as_result(opinion, bare, found.learn, found.errors, found.simulated)
    if doubt is not None:
        return left
    if left.acting is not None and misplaced(named, left.acting, found.learn)[0] is not named:
        return left
    forms = together(
        spread_by_form(named.final.model, found.learn, found.cutoff),
        spread_by_stretch(steady(found, named), named.final.model),
    )
    adequate = replace(adequacy_of(found, named), whole=True)
    return replace(left, result=named, doubt=None, away=None, adequate=adequate, forms=forms)
