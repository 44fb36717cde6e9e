"""Does each of several names earn its place beside the others?

A name that was found after others may stand for a part of what has no name: it predicts the next sample
better, and the others alone, fitted again, run as freely, or leave less torque unexplained.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ...evidence.inverse_dynamics.terms import Hypothesis
from ...evidence.second_method import NO_WORSE
from ...hypotheses.candidates import goes_with
from ...policy import CLEAR_GAIN, ERRS_LESS, FITS_WORSE, LEAST_HELD_OUT, NOTICEABLE
from ..adequacy import Adequacy
from ..corroborated import Corroboration
from ..finding import size_unknown
from ..search.decide import Choice
from ..search.rounds import SearchResult
from ..second_method.as_result import fit_of


def earned(
    result: SearchResult,
    adequate: Adequacy,
    records: Sequence[Record],
    corroborated: Corroboration,
    left: Callable[[Fit], float],
    spread: dict[str, float],
    likely: Callable[[Fit], bool],
) -> SearchResult:
    """The result without names that do not earn their place beside the others; the last one found is asked
    first, and a single one not at all. ``adequate``: how much the names explain; ``records``: those of the
    estimation; ``left``: size of the torque that the observer of a fit still adds; ``spread``: of parameters
    between recordings; ``likely``: whether likelihoods of a fit are to be taken at their word, because its
    innovations are white on both kinds. Where they are, and what is left is random, neither a free run nor a
    size that is hardly known speaks against a name that gains clearly beside the others. Of one that stays
    although the torques do not bear it out, and with which the other recordings are simulated worse, nobody
    is sure."""
    for choice in reversed(result.choices):
        if len(result.choices) < 2:
            break
        effect = choice.chosen.effect
        if choice.chosen.by_current > 0.0:
            continue
        unknown = size_unknown(choice, result.final, spread)
        if not unknown and corroborated.by_torques(result.final.model, effect):
            continue
        others = without(result, effect, records)
        clear = adequate.random_left and _clear(choice, result.final, others) and likely(result.final)
        if unknown and not clear:
            why = f"beside the others the size of {effect.effect} is not known"
        else:
            why = _torque_missing(result.final, others, effect, left)
            if why is None and not clear:
                why = _against(result.final, others, effect, adequate, corroborated)
        if why is None:
            if not choice.unsure and corroborated.elsewhere(result.final, others) > NO_WORSE:
                result = _nobody_sure(result, choice)
            continue
        result = left_out(result, choice, why, others)
    return result


def left_out(result: SearchResult, choice: Choice, why: str, final: Fit) -> SearchResult:
    """The result without one of several names, which is given up; ``final``: the fit `without` it."""
    return replace(
        result.giving_up([choice], why),
        choices=tuple(c for c in result.choices if c is not choice),
        final=final,
        by_torque=None,
        last_round=(),
        settled=(),
    )


def _nobody_sure(result: SearchResult, choice: Choice) -> SearchResult:
    """The result in which nobody is sure of a finding with which validation recordings run worse."""
    name = choice.chosen.effect.effect.replace("_", " ")
    unsure = f"the torques do not bear out the {name}, and with it validation recordings run worse"
    kept = tuple(replace(c, unsure=c.unsure or unsure) if c is choice else c for c in result.choices)
    return replace(result, choices=kept)


def _clear(choice: Choice, fit: Fit, others: Fit) -> bool:
    """Whether likelihoods speak clearly for a choice beside the ``others``, and on the other recordings spoke
    for it when it was found."""
    gain = min(choice.chosen.gain, fit.log_likelihood - others.log_likelihood)
    return gain >= CLEAR_GAIN and choice.chosen.elsewhere >= LEAST_HELD_OUT


def _torque_missing(fit: Fit, without: Fit, effect: Effect, left: Callable[[Fit], float]) -> str | None:
    """The objection that with an effect of a fit its observer adds more torque than without, None where it
    does not, or what it adds is too little to be worth a word. Both are asked at the noise levels of either:
    an observer that takes its readings for noisier adds less torque, whatever is missing."""
    pairs = [[left(replace(one, noise=n)) for one in (fit, without)] for n in (fit.noise, without.noise)]
    # A model may have no observer at the levels of the other one.
    told = [pair for pair in pairs if all(map(math.isfinite, pair))] or pairs[:1]
    with_it, others = (math.prod(sizes) ** (1.0 / len(told)) for sizes in zip(*told, strict=True))
    if not with_it > max(FITS_WORSE * others, NOTICEABLE):
        return None
    return f"beside the others, more torque is missing with {effect.effect} than without"


def _against(
    fit: Fit, without: Fit, effect: Effect, adequate: Adequacy, corroborated: Corroboration
) -> str | None:
    """What free runs say against an effect of a fit, beside the fit without it; None for nothing. Where names
    explain nearly all, or what they leave is random, free runs need not speak for it: it may be small."""
    if adequate.explains_nearly_all:
        return None
    factor = NO_WORSE if adequate.random_left else ERRS_LESS
    ratios = corroborated.by_free_runs(fit, without, effect), corroborated.elsewhere(fit, without)
    if max(ratios) < factor:
        return None
    return (
        f"beside the others only one-step predictions speak for {effect.effect}: "
        f"free-run simulations err {'more' if adequate.random_left else 'hardly less'} with it"
    )


def without(result: SearchResult, effect: Effect, records: Sequence[Record]) -> Fit:
    """The fit of a result without one of its effects, the others fitted again: by whoever named them."""
    fit = result.final
    if result.searched is not None:
        model, named = result.searched.structure.model, (c.chosen.effect for c in result.choices)
        kept = (e for e in named if (e.effect, e.location) != (effect.effect, effect.location))
        rest = tuple(Hypothesis.resized(e, model.place(e.location)) for e in kept)
        return fit_of(result.searched.group_of(rest), fit, records)
    gone = [effect]
    beside = goes_with(effect, fit.model)
    known = (*result.baseline.model.effects, *(c.chosen.effect for c in result.choices))
    if beside is not None and all((e.effect, e.location) != (beside.effect, beside.location) for e in known):
        gone.append(beside)  # it is there because of the effect alone
    model, free = fit.model, fit.free
    for one in gone:
        model = model.without(one.effect, one.location)
        head = f"{one.location}.{one.effect}."
        free = tuple(name for name in free if not name.startswith(head))
    return fit_whole(model, fit.noise, records, free=free)
