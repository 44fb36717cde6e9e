"""How much of what the torques lack the findings explain that are torques along the motion."""

from __future__ import annotations

import math

from ...evidence.inverse_dynamics.terms import Hypothesis
from ...evidence.second_method import Errors, SecondMethod
from ...hypotheses.follows import follows_from_motion
from ...policy import ERRS_FAR_LESS, LEAST_EXPLAINED
from ..corroborated import adds_torque
from ..reasons import Doubt
from ..search.decide import Choice
from ..search.rounds import SearchResult
from .overruled import error_ratios


def inadequate(result: SearchResult, second_method: SecondMethod, errors: Errors) -> Doubt | None:
    """The doubt about a name whose torque is far from what the same quantities explain without a form.

    Not where the inverse dynamics know the structure far less well than the search that named it: in a force
    loop their regression is biased by what the encoders round, and with the same names their free run
    errs more by ERRS_FAR_LESS."""
    told, group = _along_motion(result)
    if not told:
        return None
    others = [c.chosen.effect for c in result.choices if c not in told]
    theirs = second_method.searched.with_names(group)
    there = errors(theirs.with_effects(*others) if others else theirs)
    if math.prod(error_ratios(errors(result.final.model), there)) < ERRS_FAR_LESS**2:
        return None
    for choice, adequacy in zip(told, second_method.searched.folds.adequacies(group), strict=True):
        if adequacy < LEAST_EXPLAINED:
            name = choice.chosen.effect.effect
            why = (
                f"{name} explains {100 * adequacy:.0f} % of what a free curve explains "
                "in the same quantities"
            )
            return Doubt(choice, why, short=True)
    return None


def explained_along(result: SearchResult, second_method: SecondMethod) -> float:
    """Share of the torque that the motion asks for and the structure does not have which the findings that
    are torques along the motion explain, on stretches that were not fitted."""
    return second_method.searched.folds.explained(_along_motion(result)[1])


def explained_in_band(result: SearchResult, second_method: SecondMethod) -> float:
    """The same of findings of the inverse dynamics, with what an actuator does; 0 where one of them was found
    otherwise. It counts the band of the motion alone, where an observer also corrects what readings round."""
    group = _all_with_grounds(result)
    return second_method.searched.folds.explained(group) if group else 0.0


def recovered(result: SearchResult, second_method: SecondMethod) -> float:
    """Share that findings of the inverse dynamics explain of what any torques do, or the one that explains
    least of what a torque in its own quantities does, where that is less: 1 where all is explained, or one of
    the findings was found otherwise, whose sizes are not those of the torques."""
    group, searched = _all_with_grounds(result), second_method.searched
    if not group:
        return 1.0
    whole = searched.folds.explained(group) / max(searched.recoverable, 1e-300)
    return max(min(1.0, whole, *searched.folds.adequacies(group)), 0.0)


def _all_with_grounds(result: SearchResult) -> tuple[Hypothesis, ...]:
    """The findings as hypotheses; none where one of them is not from the inverse dynamics."""
    if any(c.chosen.grounds is None for c in result.choices):
        return ()
    model, effects = result.baseline.model, [c.chosen.effect for c in result.choices]
    return tuple(Hypothesis.of(e, model.place(e.location)) for e in effects if adds_torque(e))


def _along_motion(result: SearchResult) -> tuple[list[Choice], tuple[Hypothesis, ...]]:
    """The findings that are torques along the motion, and as hypotheses."""
    told = [
        c for c in result.choices if c.chosen.by_current <= 0.0 and follows_from_motion(c.chosen.effect.entry)
    ]
    model = result.baseline.model
    return told, tuple(Hypothesis.of(c.chosen.effect, model.place(c.chosen.effect.location)) for c in told)
