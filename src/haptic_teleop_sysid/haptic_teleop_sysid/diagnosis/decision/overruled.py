"""When the second opinion is believed, and what it says as a result like any other."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ..evidence.horizons import PERFECT
from ..evidence.inverse_dynamics.terms import Hypothesis
from ..evidence.inverse_dynamics.witness import A_PARAMETER, Group
from ..evidence.second_opinion import NO_WORSE, Errors, Opinion, named_by, plainer
from ..hypotheses.explanation import Explanation
from ..hypotheses.follows import follows_from_motion
from ..hypotheses.twins import twins
from ..policy import ERRS_FAR_LESS, ERRS_LESS, LEAST_EXPLAINED, LEAST_GAIN
from .adequacy import SLIGHT_ERROR
from .corroborated import adds_torque
from .decide import Choice, prior
from .free_run_sizes import Simulated, as_fitted, sized_freely
from .known_sizes import with_known_sizes
from .reasons import Doubt
from .search import SearchResult

#: Log-likelihood that the way back from a bound to the given value would cost, from which the recordings want
#: a parameter there.
WANTED = 12.0


def believed_instead(
    opinion: Opinion, named: Sequence[Effect], first: tuple[float, float], coloured: Callable[[], bool]
) -> bool:
    """Whether the second opinion is believed; ``named``: what the first one found, ``first``: errors of its
    free runs (see `second_opinion.Errors`), ``coloured``: whether its innovations show that its noise model
    does not hold, which takes a fit and is asked only where it decides."""
    if opinion.chosen is None:
        return False
    return errs_enough_less(
        opinion.chosen.errors, first, lambda: _torques_agree(opinion, named) or coloured()
    )


def errs_enough_less(
    one: tuple[float, float], first: tuple[float, float], excused: Callable[[], bool]
) -> bool:
    """Whether free runs with other names err so much less (``one``) than those of what was found first that
    they take its place: by ERRS_FAR_LESS, or by ERRS_LESS where ``excused`` says that the first one's
    likelihoods are not to be taken at their word, or that other evidence speaks against them."""
    ratios = _ratios(one, first)
    # The validation recordings decide: a model errs less where it was fitted, whatever it is worth.
    if ratios[1] >= NO_WORSE or math.prod(ratios) >= ERRS_LESS**2:
        return False
    # What errs far less where neither was fitted is not made worse by a first one that fits the rest closely.
    return min(math.prod(ratios), ratios[1]) < ERRS_FAR_LESS**2 or excused()


def _torques_agree(opinion: Opinion, named: Sequence[Effect]) -> bool:
    """Whether the second opinion has the names of the first one, ``named``, and other sizes; or others by
    which the torques gain LEAST_GAIN more, and as much for each name more, on stretches that were not fitted
    and beyond what each parameter must gain. What is no torque is not compared, nor is no name at all."""
    assert opinion.chosen is not None
    group, folds = opinion.chosen.group, opinion.witness.folds
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


def stands_next(opinion: Opinion, first: tuple[float, float]) -> bool:
    """Whether the second opinion's names stand where the first one gave up what it had found: they explain
    most of what can be explained, and their free runs err no more than ``first``."""
    chosen = opinion.chosen
    return chosen is not None and opinion.explains_most and max(_ratios(chosen.errors, first)) < NO_WORSE


def more_plainly(opinion: Opinion, result: SearchResult, first: tuple[float, float]) -> bool:
    """Whether the second opinion has the names of a result, one of them in its plainer form, explains most of
    what can be explained with them, and runs nearly as well as the result, whose free runs err by ``first``;
    errors that are not worth a word (SLIGHT_ERROR) are as good as none."""
    chosen = opinion.chosen
    names = {(c.chosen.effect.effect, c.chosen.effect.location) for c in result.choices}
    if chosen is None or not plainer({(e.effect, e.location) for e in chosen.group.effects}, names):
        return False
    pairs = zip(chosen.errors, first, strict=True)
    worse = max(max(own, SLIGHT_ERROR) / max(other, SLIGHT_ERROR) for own, other in pairs)
    return opinion.explains_most and worse < 1.0 / ERRS_LESS


def _ratios(one: tuple[float, float], other: tuple[float, float]) -> list[float]:
    """Errors of free runs relative to another model's, of either kind of recordings."""
    return [max(own, PERFECT) / max(there, PERFECT) for own, there in zip(one, other, strict=True)]


def as_result(
    opinion: Opinion,
    predicted: SearchResult,
    records: Sequence[Record],
    errors: Errors,
    simulated: Simulated,
) -> tuple[SearchResult, Doubt | None]:
    """The second opinion as a search's result, and the doubt where its name explains too little; ``errors``,
    ``simulated``: see `free_run_sizes`."""
    assert opinion.chosen is not None
    # The sizes are those of runs as long as the reported ones.
    heard = replace(opinion.chosen, errors=errors(opinion.chosen.group.model))
    fastest = predicted.scales.size["fastest"]
    opinion = with_known_sizes(
        replace(opinion, chosen=heard), lambda h: sized_freely(h, simulated, errors, fastest), errors
    )
    assert opinion.chosen is not None
    baseline = predicted.baseline
    alone = opinion.witness.structure
    if errors(alone.model)[0] < errors(baseline.model)[0]:
        baseline = fit_of(alone, baseline, records)
    group = opinion.chosen.group
    final = fit_of(group, baseline, records)
    sized = len(group.effects) == len(heard.group.effects) and group is not heard.group
    other = fit_of(heard.group, baseline, records) if sized else None
    adequacy = opinion.adequacy
    choices = tuple(
        _choice(opinion, final, len(group.model.effects) - len(group.effects) + i)
        for i in range(len(group.effects))
    )
    if adequacy < LEAST_EXPLAINED:
        search = opinion.witness.folds
        shapes = {n for h in group.hypotheses for latent in search.alike(h) for n in latent.quantities}
        names = " and ".join(f"{e.effect} at {e.location}" for e in group.effects)
        why = (
            f"the most similar effect, {names}, explains {100 * adequacy:.0f} % of what a torque without a "
            f"form explains in the same quantities ({', '.join(sorted(shapes))})"
        )
        bare = replace(predicted, baseline=baseline, final=baseline, choices=(), last_round=(), nameless=None)
        return bare, Doubt(choices[0], why, " and ".join(sorted(shapes)) or None, short=True)
    named = replace(predicted, baseline=baseline, final=final, choices=choices, by_torque=other)
    return replace(named, last_round=(), nameless=None, witness=opinion.witness), None


def inadequate(result: SearchResult, opinion: Opinion, errors: Errors) -> Doubt | None:
    """The doubt about a name whose torque is far from what the same quantities explain without a form.

    Not where the inverse dynamics know the structure far less well than the search that named it: in a force
    loop their regression is biased by what the encoders round, and with the same names their free run
    errs more by ERRS_FAR_LESS."""
    told, group = _along_motion(result)
    if not told:
        return None
    others = [c.chosen.effect for c in result.choices if c not in told]
    theirs = opinion.witness.with_names(group)
    there = errors(theirs.with_effects(*others) if others else theirs)
    if math.prod(_ratios(errors(result.final.model), there)) < ERRS_FAR_LESS**2:
        return None
    for choice, adequacy in zip(told, opinion.witness.folds.adequacies(group), strict=True):
        if adequacy < LEAST_EXPLAINED:
            name = choice.chosen.effect.effect
            why = (
                f"{name} explains {100 * adequacy:.0f} % of what a torque without a form explains "
                "in the same quantities"
            )
            return Doubt(choice, why, short=True)
    return None


def explained_along(result: SearchResult, opinion: Opinion) -> float:
    """Share of the torque that the motion asks for and the structure does not have which the findings that
    are torques along the motion explain, on stretches that were not fitted."""
    return opinion.witness.folds.explained(_along_motion(result)[1])


def explained_in_band(result: SearchResult, opinion: Opinion) -> float:
    """The same of findings of the inverse dynamics, with what an actuator does; 0 where one of them was found
    otherwise. It counts the band of the motion alone, where an observer also corrects what readings round."""
    if any(c.chosen.witnessed is None for c in result.choices):
        return 0.0
    model, effects = result.baseline.model, [c.chosen.effect for c in result.choices]
    group = tuple(Hypothesis.of(e, model.place(e.location)) for e in effects if adds_torque(e))
    return opinion.witness.folds.explained(group)


def _along_motion(result: SearchResult) -> tuple[list[Choice], tuple[Hypothesis, ...]]:
    """The findings that are torques along the motion, and as hypotheses."""
    told = [
        c for c in result.choices if c.chosen.by_current <= 0.0 and follows_from_motion(c.chosen.effect.entry)
    ]
    model = result.baseline.model
    return told, tuple(Hypothesis.of(c.chosen.effect, model.place(c.chosen.effect.location)) for c in told)


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


def fit_of(group: Group, like: Fit, records: Sequence[Record]) -> Fit:
    """The group's model as it is, with noise levels for its observer and the regression's standard errors."""
    return replace(as_fitted(group.model, group.std, like, records), at_bound=group.at_bound)


def _choice(opinion: Opinion, final: Fit, index: int) -> Choice:
    """One effect of the chosen group, with its share of what is believed, and what else it may be."""
    chosen, effect = opinion.chosen, final.model.effects[index]
    assert chosen is not None
    own, others = 0.0, dict[tuple[str, str], tuple[Effect, float]]()
    known = {(e.effect, e.location) for e in chosen.group.effects}
    for heard, weight in opinion.rivals:
        if any((e.effect, e.location) == (effect.effect, effect.location) for e in heard.group.effects):
            own += weight
            continue
        for e in heard.group.effects:
            if (e.effect, e.location) not in known:
                before = others.get((e.effect, e.location), (e, 0.0))[1]
                others[e.effect, e.location] = (e, before + weight)
    # One and the same to these recordings.
    there = {(e.effect, e.location) for e in final.model.effects}
    same = [e for e in twins(effect, final.model.rigid) if (e.effect, e.location) not in {*others, *there}]
    likely = [prior(e.effect, e.location, False) for e in same]
    own /= 1.0 + sum(likely)
    for e, share in zip(same, likely, strict=True):
        others[e.effect, e.location] = (e, own * share)
    told = (
        f"of the torque that the motion asks for and the structure does not have, it explains "
        f"{100 * chosen.group.explained:.0f} % on recordings that were not fitted"
        if len(known) == 1
        else f"together they explain {100 * chosen.group.explained:.0f} % of the torque that the motion asks "
        "for and the structure does not have, on recordings that were not fitted"
    )
    told += f", and a free run errs by {100 * chosen.errors[1]:.1f} % of the motion there"
    explanation = Explanation(final, chosen.gain, 0.0, True, index, witnessed=told)

    def instead(other: Effect) -> Explanation:
        effects = (*final.model.effects[:index], other, *final.model.effects[index + 1 :])
        return replace(explanation, fit=replace(final, model=replace(final.model, effects=effects)))

    rivals = sorted(others.values(), key=lambda o: -o[1])
    return Choice(explanation, own, tuple((instead(e), p) for e, p in rivals if p > 0.02))
