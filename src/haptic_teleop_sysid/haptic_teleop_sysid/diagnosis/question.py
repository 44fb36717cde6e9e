"""What is left of the findings after the questions that likelihoods do not ask."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.recordings.dataset import DataSet

from .decision.adequacy import Adequacy, Followed, adequacy, left_size
from .decision.coloured import coloured, in_detail, left_is_random, with_a_memory
from .decision.corroborated import Corroboration
from .decision.finding import shape_unknown, size_unknown
from .decision.name_tests.at_bounds import within_bounds
from .decision.name_tests.beside_the_others import earned
from .decision.name_tests.changing_size import one_size_each
from .decision.name_tests.doubt import doubted
from .decision.name_tests.encoder_correction import misread
from .decision.name_tests.law import by_its_law
from .decision.name_tests.parameter_constancy import inconstant
from .decision.name_tests.size_over_time import constant_sizes
from .decision.reasons import (
    Doubt,
    follows_in_detail,
    more_than_chance,
    off_the_mark,
    runs_away,
    slipped,
)
from .decision.search.decide import Choice
from .decision.search.rounds import SearchResult
from .decision.second_method.as_result import as_result
from .decision.second_method.overruled import believed_instead, beyond_reach, more_plainly, stands_next
from .decision.second_method.torques_explained import (
    explained_along,
    explained_in_band,
    inadequate,
    recovered,
)
from .decision.stand import Stand, colours, stand_of
from .decision.where import structured
from .evidence.held_out import with_both_kinds
from .evidence.proof import mean_percent
from .evidence.residual import INPUT_TORQUE, conditions
from .evidence.second_method import Errors, SecondMethod
from .evidence.steadiness import Steadiness, steadiness
from .explain import Explained
from .hypotheses.follows import follows_from_motion
from .policy import WHITE, WORSE


def questioned(
    found: Explained, believed: SearchResult, kept: SearchResult, data: list[DataSet]
) -> tuple[SearchResult, Doubt | None, Stand]:
    """What is left of the findings ``kept`` after the questions that likelihoods do not ask; ``believed``:
    what the search by prediction found, so far as chance leaves it."""
    harmful = None if kept.choices else next(iter(believed.choices), None)
    corroborated = Corroboration(found.horizons.errors, found.second_method)
    result, doubt, stand = doubted(kept, found.learn, found.judge, found.chosen_by, corroborated)
    result, wrong = misread(result, found.given, found.learn, found.judge, found.cutoff)
    if wrong is not None:
        result = _before(result, *wrong)
        doubt = doubt if result.choices else (doubt or Doubt(*wrong))
    first = result.nameless.chosen.fit if result.nameless is not None else result.final
    first_errors, second_method = found.horizons.errors(first.model), found.second_method
    named = [c.chosen.effect for c in result.choices]

    def instead(why: str) -> tuple[SearchResult, Doubt | None, Stand]:
        assert second_method is not None
        bare = result.giving_up(result.choices, why)
        return *as_result(second_method, bare, found.learn, found.errors, found.simulated), alone

    alone = Stand(stand.before, stand.after, {})
    if second_method is not None and believed_instead(
        second_method, named, first_errors, lambda: coloured(first, found.learn, found.judge)
    ):
        return instead("what the inverse dynamics name simulates all recordings better")
    if (
        second_method is not None
        and any(shape_unknown(c, result.final, stand.spread) for c in result.choices)
        and more_plainly(second_method, result, first_errors)
    ):
        return instead("what is more than the plainer form of the inverse dynamics is not known")
    # Where what is left is random, a free curve follows chance.
    left = (
        bool(result.choices) and doubt is None and not left_is_random(result.final, found.learn, found.judge)
    )
    short = (
        inadequate(result, second_method, found.horizons.errors)
        if second_method is not None and left
        else None
    )
    if short is not None:
        result = _before(result, short.choice, short.why)
        doubt = None if result.choices else short
    while doubt is None and (far := beyond_reach(result, found.given)) is not None:
        # Names found before it may not need that machine.
        result = _before(result, result.choices[-1], far.why)
        if result.choices:
            stand = stand_of(result, stand.before, found.learn, found.judge)
        else:
            doubt, stand = far, Stand(stand.before, stand.before, {})
    if (
        doubt is None
        and second_method is not None
        and _gives_way(result, stand, second_method, found.horizons.errors)
    ):
        return instead(
            "a size among these names is not known, and as few of the inverse dynamics explain nearly all"
        )
    if doubt is not None and doubt.choice is not None and not result.choices:
        # A name that is given up brings up the next; physics without a name is an answer and stays.
        nothing = found.horizons.errors(result.final.model)
        if second_method is not None and result.nameless is None and stands_next(second_method, nothing):
            return instead("what the inverse dynamics name explains nearly all")
        return result, doubt, stand
    if harmful is not None and (doubt is None or doubt.choice is None):
        doubt = runs_away(harmful)
    if doubt is None and not result.choices:
        fits = found.course.simulate(result.baseline.model)[found.count :]
        doubt = (
            off_the_mark(mean_percent(fits))
            or slipped(data)
            or inconstant(result.baseline, found.judge)
            or follows_in_detail(
                with_both_kinds(result.baseline, found.learn, found.judge), result.scales.size["torque"]
            )
            or more_than_chance(left_size(result.baseline, [*found.learn, *found.judge]))
        )
    return result, doubt, stand


def lawful(
    found: Explained, result: SearchResult
) -> tuple[SearchResult, Doubt | None, Followed | None]:
    """The result without names whose law is not the joint's (see `by_its_law`; what free runs found has other
    sizes than the likelihood's, and is not asked), or that ended at a bound beside the rest, whose moments
    and sizes may be others now; the doubt where no name is left, and what one that went follows where some
    are."""
    followed = doubt = None
    if not found.freely:
        result, doubt, followed = by_its_law(result, found.learn, found.judge)
    result, beyond = within_bounds(result, found.learn)
    return result, doubt or beyond, followed


def weighed(
    found: Explained, result: SearchResult, stand: Stand
) -> tuple[SearchResult, Adequacy | None, Doubt | None]:
    """The result without names that do not earn their place beside the others (see `earned`) or are no
    constants of the joint (`constant_sizes`); how much of what is missing the rest explains, None where none
    is left; and why."""
    corroborated = Corroboration(found.horizons.errors, found.second_method)

    def size_left(fit: Fit) -> float:
        return left_size(fit, [*found.learn, *found.judge])

    def likely(fit: Fit) -> bool:
        # Gains of free runs are no likelihoods.
        return not found.freely and max(colours(fit, found.learn, found.judge)) <= WHITE

    before = adequate = doubt = None
    while result.choices and result is not before:
        before, adequate = result, adequacy_of(found, result)
        kept = earned(result, adequate, found.learn, corroborated, size_left, stand.spread, likely)
        kept = one_size_each(kept, found.learn, found.judge)
        result, doubt = constant_sizes(kept, lambda one: steady(found, one), found.learn)
    return result, adequate if result.choices else None, doubt


def steady(found: Explained, result: SearchResult) -> dict[tuple[str, str], Steadiness]:
    """How steady the sizes of a result's names are along all recordings."""
    named = [c.chosen.effect for c in result.choices]
    return steadiness(result.final.model, named, [*found.learn, *found.judge], found.cutoff)


def adequacy_of(found: Explained, result: SearchResult) -> Adequacy:
    """How much of what is missing a result's names explain."""
    random = left_is_random(result.final, found.learn, found.judge)
    models = found.given, result.final.model
    own, with_names = (float(np.mean(found.course.percent(model)[found.count :])) for model in models)
    adequate = adequacy(
        result.baseline,
        result.final,
        [*found.learn, *found.judge],
        *(found.errors(fit.model) for fit in (result.baseline, result.final)),
        random_left=random,
        by_torque=result.by_torque,
        by_motion=lambda: (
            0.0 if found.second_method is None else explained_along(result, found.second_method)
        ),
        in_band=0.0 if found.second_method is None else explained_in_band(result, found.second_method),
        follows=None if random else followed_by_most(found, result),
        worse=own > 0.0 and own - with_names > WORSE,  # what follows nothing is not better
        white=lambda: max(colours(result.final, found.learn, found.judge)) <= WHITE,
    )
    if found.second_method is None:
        return adequate
    return replace(adequate, recovered=recovered(result, found.second_method))


def followed_by_most(found: Explained, result: SearchResult) -> Followed | None:
    """What most of the left-over torque follows, None for nothing to speak of."""
    if in_detail(result.final, found.learn, found.judge):
        return Followed(found.given.location("actuator"), f"{INPUT_TORQUE}, in steps too fine for a law")
    left = conditions(result.final, found.learn, found.judge, found.given.joint)
    if (curve := structured(result.final, left, found.learn, result)) is not None:
        return Followed(curve.equation, curve.name)
    past = with_a_memory(result.final, found.learn, found.judge)
    return None if past is None else Followed(past.equation, f"{past.name}, with a memory")


def _gives_way(result: SearchResult, stand: Stand, second_method: SecondMethod, errors: Errors) -> bool:
    """Whether one of the findings is a torque along the motion whose size is not known, nor that of another
    torque that it may be, while no more names of the inverse dynamics explain nearly all, and simulate freely
    no worse than the structure alone."""
    unknown = [
        c
        for c in result.choices
        if follows_from_motion(c.chosen.effect.entry)
        and size_unknown(c, result.final, stand.spread)
        and all(
            size_unknown(replace(c, chosen=e), e.fit, {})
            for e, _ in c.others
            if follows_from_motion(e.effect.entry)
        )
    ]
    return (
        bool(unknown)
        and second_method.chosen is not None
        and len(second_method.chosen.group.effects) <= len(result.choices)
        and stands_next(second_method, errors(result.baseline.model))
    )


def _before(result: SearchResult, choice: Choice | None, why: str) -> SearchResult:
    """The result up to a finding that is given up, and with it what was found beside it; None: all are."""
    kept = result.choices[: result.choices.index(choice)] if choice else ()
    final = kept[-1].chosen.fit if kept else result.baseline
    given_up = result.giving_up(result.choices[len(kept) :], why)
    return replace(given_up, choices=kept, final=final, last_round=())
