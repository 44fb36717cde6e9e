"""When the second method is believed, and what it says as a result like any other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES

from ...evidence.horizons import PERFECT
from ...evidence.inverse_dynamics.group_search import A_PARAMETER
from ...evidence.inverse_dynamics.terms import Hypothesis
from ...evidence.second_method import NO_WORSE, SecondMethod, named_by, plainer
from ...policy import ERRS_FAR_LESS, ERRS_LESS, LEAST_GAIN
from ..adequacy import SLIGHT_ERROR
from ..corroborated import adds_torque
from ..reasons import Doubt
from ..search.rounds import SearchResult

#: Log-likelihood that the way back from a bound to the given value would cost, from which the recordings want
#: a parameter there.
WANTED = 12.0


def believed_instead(
    second_method: SecondMethod,
    named: Sequence[Effect],
    first: tuple[float, float],
    coloured: Callable[[], bool],
) -> bool:
    """Whether the second method is believed; ``named``: what the first one found, ``first``: errors of its
    free runs (see `second_method.Errors`), ``coloured``: whether its innovations show that its noise model
    does not hold, which takes a fit and is asked only where it decides."""
    if second_method.chosen is None:
        return False
    return errs_enough_less(
        second_method.chosen.errors, first, lambda: _torques_agree(second_method, named) or coloured()
    )


def errs_enough_less(
    one: tuple[float, float], first: tuple[float, float], excused: Callable[[], bool]
) -> bool:
    """Whether free runs with other names err so much less (``one``) than those of what was found first that
    they take its place: by ERRS_FAR_LESS, or by ERRS_LESS where ``excused`` says that the first one's
    likelihoods are not to be taken at their word, or that other evidence speaks against them."""
    ratios = error_ratios(one, first)
    # The validation recordings decide: a model errs less where it was fitted, whatever it is worth.
    if ratios[1] >= NO_WORSE or math.prod(ratios) >= ERRS_LESS**2:
        return False
    # What errs far less where neither was fitted is not made worse by a first one that fits the rest closely.
    return min(math.prod(ratios), ratios[1]) < ERRS_FAR_LESS**2 or excused()


def _torques_agree(second_method: SecondMethod, named: Sequence[Effect]) -> bool:
    """Whether the second method has the names of the first one, ``named``, and other sizes; or others by
    which the torques gain LEAST_GAIN more, and as much for each name more, on stretches that were not fitted
    and beyond what each parameter must gain. What is no torque is not compared, nor is no name at all."""
    assert second_method.chosen is not None
    group, folds = second_method.chosen.group, second_method.searched.folds
    known = {(e.effect, e.location) for e in named}
    if named_by(group) == known:
        return True
    if not named or not all(map(adds_torque, named)):
        return False
    theirs = tuple(Hypothesis.resized(e, folds.model.place(e.location)) for e in named)
    more = sum(map(_free, named)) - sum(map(_free, group.effects))
    try:
        gained = folds.likelier(group.hypotheses) - folds.likelier(theirs)
    except FAILURES:
        return False
    names = 1 + max(len(group.effects) - len(known), 0)
    return gained + A_PARAMETER * more > LEAST_GAIN * names


def _free(effect: Effect) -> int:
    """How many of an effect's parameters were sought."""
    return sum(p.default is None or bool(p.turns) for p in effect.entry.parameters)


def stands_next(second_method: SecondMethod, first: tuple[float, float]) -> bool:
    """Whether the second method's names stand where the first one gave up what it had found: they explain
    most of what can be explained, and their free runs err no more than ``first``."""
    chosen = second_method.chosen
    return (
        chosen is not None
        and second_method.explains_most
        and max(error_ratios(chosen.errors, first)) < NO_WORSE
    )


def more_plainly(second_method: SecondMethod, result: SearchResult, first: tuple[float, float]) -> bool:
    """Whether the second method has the names of a result, one of them in its plainer form, explains most of
    what can be explained with them, and runs nearly as well as the result, whose free runs err by ``first``;
    errors that are not worth a word (SLIGHT_ERROR) are as good as none."""
    chosen = second_method.chosen
    names = {(c.chosen.effect.effect, c.chosen.effect.location) for c in result.choices}
    if chosen is None or not plainer({(e.effect, e.location) for e in chosen.group.effects}, names):
        return False
    pairs = zip(chosen.errors, first, strict=True)
    worse = max(max(own, SLIGHT_ERROR) / max(other, SLIGHT_ERROR) for own, other in pairs)
    return second_method.explains_most and worse < 1.0 / ERRS_LESS


def error_ratios(one: tuple[float, float], other: tuple[float, float]) -> list[float]:
    """Errors of free runs relative to another model's, of either kind of recordings."""
    return [max(own, PERFECT) / max(there, PERFECT) for own, there in zip(one, other, strict=True)]


def beyond_reach(result: SearchResult, lab: Model) -> Doubt | None:
    """The doubt about names that need a machine which is not the lab's: with them an inertia, a stiffness or
    a torque constant ends at the bound of what is taken for possible, and the recordings want it further."""
    fit = result.final
    if not result.choices:
        return None
    given = lab.parameter_values()
    for name in fit.at_bound:
        # A damping may be none.
        if name not in lab.parameters or name.endswith("damping") or name not in fit.free:
            continue
        value = fit.model.parameter_values()[name]
        back = abs(float(fit.gradient[fit.free.index(name)]) * (given[name] - value))
        if back > WANTED:
            names = " and ".join(c.chosen.effect.effect for c in result.choices)
            why = (
                f"with {names} the {name.replace('_', ' ')} would be {value:.3g} instead of "
                f"{given[name]:.3g}, the bound of what is taken for possible, or beyond"
            )
            return Doubt(result.choices[0], why)
    return None
