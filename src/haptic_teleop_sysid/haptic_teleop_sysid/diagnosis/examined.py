"""What is left of the names that are believed when they are held against what needs no search: the place
where something acts, the law of each, and how much of what is missing they explain."""

from __future__ import annotations

from dataclasses import dataclass, replace

from haptic_teleop_sim.model import Model

from .believed import Believed, Say
from .decision.adequacy import Adequacy, following, short_of
from .decision.finding import unsure_of_their_shape
from .decision.name_tests.any_curve import follows_still, one_curve
from .decision.name_tests.curve_instead import outdone
from .decision.name_tests.measured_input import of_measured_input
from .decision.name_tests.parameter_constancy import apart
from .decision.name_tests.place import misplaced
from .decision.name_tests.unconfirmed import unconfirmed
from .decision.reasons import Doubt
from .decision.search.rounds import SearchResult
from .evidence.acting_place import ActingPlace
from .evidence.measured_map import A_GOOD_TORQUE, MeasuredMap, measured_map
from .evidence.other_forms import spread_by_form, together
from .evidence.steadiness import spread_by_stretch
from .explain import Explained
from .question import lawful, steady, weighed


@dataclass(frozen=True)
class Examined:
    """What is left, and the ``doubt`` that something else is there; ``away``: where that says so, the doubt
    about names at a place where nothing acts; ``acting``: the parity equations, None where there are none;
    ``adequate``: how much the names explain, None where there are none; ``forms``: how far parameters are
    apart by the form of a law and by stretches."""

    result: SearchResult
    doubt: Doubt | None
    away: Doubt | None
    acting: ActingPlace | None
    adequate: Adequacy | None
    forms: dict[str, float]


def examined(model: Model, belief: Believed, say: Say) -> Examined:
    """What is left of the names in a ``belief``; ``model``: the user's."""
    found, doubt, away = belief.found, belief.doubt, None
    result = of_measured_input(unconfirmed(belief.result, found.nearby), belief.read, belief.estimation)
    # The given model: a re-estimated one has made up for what is missing.
    acting = ActingPlace.of(model, [*found.learn, *found.judge], found.cutoff)
    if acting is not None:
        result, away = misplaced(result, acting, found.learn)
        doubt = away or doubt
    result, bent = one_curve(result)
    result, wrong, followed = lawful(found, result)
    doubt, adequate = bent or doubt or wrong, None
    if any(c.chosen.by_current <= 0.0 for c in result.choices):
        result, adequate, varying = weighed(found, result, belief.stand)
        doubt = doubt or varying
    adequate = following(adequate, followed)
    if adequate is not None:
        if acting is not None:
            named = [c.chosen.effect for c in result.choices]
            adequate = replace(adequate, parity=acting.explained(named))
        result, short = short_of(result, adequate)
        result, bent = follows_still(result, found.learn, found.judge)
        result, curved = outdone(
            result, found.errors, lambda one, least: drawn_beside(found, one, say, least)
        )
        doubt = curved or doubt or short or bent
    result = result.without_companions()
    if not result.choices and doubt is not None:
        doubt = apart(result.baseline, found.learn) or doubt
    forms = forms_of(found, result)
    spread = together(belief.stand.spread, forms)
    result = replace(result, choices=unsure_of_their_shape(result.choices, result.final, spread))
    return Examined(result, doubt, away, acting, adequate, forms)


def forms_of(found: Explained, result: SearchResult) -> dict[str, float]:
    """How far parameters of a result are apart by the form of a law and by stretches."""
    model = result.final.model
    by_stretch = spread_by_stretch(steady(found, result), model)
    return together(spread_by_form(model, found.learn, found.cutoff), by_stretch)


def drawn_beside(
    found: Explained, result: SearchResult, say: Say, least: float = A_GOOD_TORQUE
) -> MeasuredMap:
    """The map of what a result leaves; ``least``: see `measured_map`."""
    base, given, parts = result.final, found.given, (found.learn, found.judge)
    return measured_map(base, given, *parts, found.errors, say, found.cutoff, found.resized, least)
