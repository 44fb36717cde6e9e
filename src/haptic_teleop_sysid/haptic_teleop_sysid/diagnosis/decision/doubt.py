"""Is the named effect really it?  Questions that likelihoods of rivals do not ask.

A name is only as good as its rivals: what stands for physics that no effect describes wins against all of
them and is wrong all the same.  But it gives itself away.  Fitted to other recordings it has another size,
because it imitates; its size follows something that is not in it (`modulation.py`); what the observer
corrects stays predictable from one sample to the next, because the cause still acts (portmanteau test, Ljung
and Box 1978); or the observer is surprised at some times and not at others, because what acts comes and goes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..evidence.certainty import known_beside, standard_errors
from ..evidence.events import all_the_time
from ..evidence.held_out import held_out_fit
from ..evidence.modulation import changes_with, modulations
from ..evidence.null_records import expected_colour, null_records, rounding_shows
from ..evidence.residual import Condition, conditions
from ..evidence.whiteness import colour, in_steps, unsteadiness
from ..hypotheses.explanation import Explanation
from ..policy import COLOURED, MOST_RANDOM, NOTICEABLE, ONLY_HERE, STILL_RANDOM, UNSTEADY, WHITE
from .adequacy import left_size
from .corroborated import Corroborated
from .decide import Choice, significant
from .reasons import Doubt, momentary, rather_event
from .search import SearchResult
from .stand import Stand, stand_of, stands_out

#: Share of the baseline's value from which an effect has not explained that.
UNCHANGED = 0.3
#: Factor over the colour of simulated recordings of the same fit, beyond which it is not the encoders'.
BY_ROUNDING = 2.0
#: Innovations (rms) in steps of the encoder, above which rounding is less than a twelfth of their power.
LARGER_THAN_STEPS = 1.0
#: Share of the baseline's unsteadiness from which an effect has not explained that.
AS_UNSTEADY = 0.7
#: A size is another one on other recordings when it differs by this share and by this many standard errors.
OTHER_SIZE = 0.4
OTHER_SIZE_ERRORS = 5.0
#: Relative change of a size, per standard deviation of what it changes with, and nats, from which on both
#: kinds of recordings the effect is something else: of 173 torques that were named right on two seeds of the
#: benchmark none changed by more than 9 % (a hysteresis of another form); what follows another axis, by 53 %.
CHANGES, CHANGES_GAIN = 0.3, 30.0
#: A finding that takes away this share of the simulation's error on validation recordings stays, whatever is
#: left beside it.
CLEARLY_BETTER = 0.4


def doubted(
    result: SearchResult,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    percent: Callable[[Model], Sequence[float]],
    corroborated: Corroborated,
) -> tuple[SearchResult, Doubt | None, Stand]:
    """The result without findings that do not stand up to the questions, what was given up, and how the
    rest stands.

    ``percent``: simulated fits of a model on the validation recordings: of all signals, and of velocities,
    because the position of an axis that nothing holds drifts with every model; ``corroborated``: whether
    anything but likelihoods speaks for an effect of a fit, beside the fit without it.
    """
    there = held_out_fit(result.baseline, validation, [result.baseline.noise, result.final.noise])
    before = colour(result.baseline, estimation), colour(there, validation)
    if not result.choices:
        stand = Stand(before, before, {})
        if result.nameless is not None:
            sentence = result.nameless.chosen.effect.entry.sentence
            why = f"it looks as if {sentence}, for which there is no name: no named effect explains as much"
            fit = result.nameless.chosen.fit
            after = [(fit, estimation), (held_out_fit(fit, validation, [fit.noise]), validation)]
            return result, rather_event(Doubt(result.nameless, why), after), stand
        both = [(result.baseline, estimation), (there, validation)]
        here = [e for e in result.last_round if e.gain > ONLY_HERE and e.material and significant(e)]
        if here:
            best = max(here, key=lambda e: e.gain)
            why = (
                f"with {best.effect.effect} the log-likelihood of the estimation recordings would rise by "
                f"{best.gain:.0f}, but the others do not bear it out"
            )
            return result, rather_event(Doubt(Choice(best, 1.0), why), both), stand
        if min(before) > COLOURED and _more_coloured(before, both):
            why = "the observer keeps correcting in one and the same direction"
            return result, rather_event(Doubt(None, why, "throughout"), both), stand
        if unsteadiness(both) > UNSTEADY:
            doubt = Doubt(None, "something acts at some times and not at others", "time")
            return result, rather_event(doubt, both), stand
        return result, None, stand
    kept = list(result.choices)
    doubt: Doubt | None = None
    asked: Explanation | None = None

    def given_up(last: Choice, why: str, condition: str | None = None) -> None:
        # What is said is what speaks against the name that came first.
        nonlocal doubt, result
        result = result.giving_up([last], why)
        if doubt is None or doubt.choice is None or not _instead_of(doubt.choice, last):
            doubt = Doubt(last, why, condition)

    both = [(result.baseline, estimation), (there, validation)]
    rounded = min(before) > COLOURED and _by_steps(before, both)
    rounding = _Rounding(result.baseline, estimation)
    while True:
        while rounded and (steps := rounding.first(kept)) is not None:
            name = steps.chosen.effect.effect
            given_up(steps, f"with encoders this coarse {name} would show on recordings without it, too")
            kept = _without_last(kept[: kept.index(steps) + 1])
        if kept and kept[-1].chosen is not asked:
            so_far = kept[-2].chosen.fit if len(kept) > 1 else result.baseline
            why = momentary(kept[-1], so_far, estimation, validation) or _objection(
                kept[-1],
                so_far,
                result.baseline,
                there,
                before,
                estimation,
                validation,
                percent,
                corroborated,
            )
            if why is not None:
                given_up(kept[-1], *why)
                kept = _without_last(kept)
                continue
            asked = kept[-1].chosen
        final = kept[-1].chosen.fit if kept else result.baseline
        if doubt is not None:
            result = replace(result, choices=tuple(kept), final=final, last_round=())
        stand = stand_of(result, before, estimation, validation)
        faint = next((c for c in kept if not stands_out(c, final, stand, validation)), None)
        if faint is None:
            if kept or doubt is None:
                return result, None, stand
            return result, rather_event(doubt, both), stand
        # What was found after it stood beside it, and falls with it.
        kept = _without_last(kept[: kept.index(faint) + 1])
        name = faint.chosen.effect.effect
        given_up(faint, f"the size of {name} differs so much between recordings that it may be none")


def _more_coloured(found: tuple[float, float], fits: Sequence[tuple[Fit, Sequence[Record]]]) -> bool:
    """Whether innovations are clearly more coloured on both kinds of recordings than coarse encoders make
    those of a true model."""
    return all(c > BY_ROUNDING * expected_colour(*one) for c, one in zip(found, fits, strict=True))


def _by_steps(found: tuple[float, float], fits: Sequence[tuple[Fit, Sequence[Record]]]) -> bool:
    """Whether innovations are as coloured as coarse encoders make those of a true model, and no larger than
    these encoders' steps: larger ones have another cause."""
    return all(in_steps(*one) < LARGER_THAN_STEPS for one in fits) and not _more_coloured(found, fits)


def coloured(fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]) -> bool:
    """Whether the innovations of a fit are coloured on both kinds of recordings, by more than coarse encoders
    make them: then its noise model does not hold, and its likelihoods are not to be taken at their word."""
    there = held_out_fit(fit, validation, [fit.noise])
    found = colour(fit, estimation), colour(there, validation)
    return min(found) > COLOURED and _more_coloured(found, [(fit, estimation), (there, validation)])


def left_is_random(fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]) -> bool:
    """Whether what a fit leaves is random as far as these recordings show: its innovations are white, and the
    left-over torque is no larger than chance is on a machine and follows nothing that was measured to speak
    of."""
    if not left_size(fit, [*estimation, *validation]) <= MOST_RANDOM or coloured(fit, estimation, validation):
        return False
    found = conditions(fit, estimation, validation, fit.model.joint)
    return all(c.explained <= STILL_RANDOM or _slight(c, fit, estimation) for c in found)


def _slight(left: Condition, fit: Fit, estimation: Sequence[Record]) -> bool:
    """Whether what follows a quantity is too small a torque to be worth a word."""
    input_ = np.sqrt(np.mean([np.mean(r.input**2) for r in estimation]))
    return bool(left.size <= NOTICEABLE * abs(pack(fit.model).torque_constant) * input_)


def _changing(
    fit: Fit, again: Fit, effect: Effect, estimation: Sequence[Record], validation: Sequence[Record]
) -> tuple[str, float] | None:
    """What the size of an effect changes with, and by how much; None where it keeps it.

    A coarse encoder tells late that a joint has turned or begins to move: what the size changes by on
    simulated recordings of the same fit, where it is constant, is the encoder's."""
    found = changes_with(
        modulations(fit, effect, estimation), modulations(again, effect, validation), CHANGES, CHANGES_GAIN
    )
    if not found:
        return None
    made = modulations(fit, effect, null_records(fit, estimation))
    for what, share in found:
        by_rounding = made[what].share if what in made else 0.0
        if abs(share) > BY_ROUNDING * abs(by_rounding):
            return what, share
    return None


class _Rounding:
    """Which findings stand for the steps of coarse encoders; every one is asked once."""

    def __init__(self, baseline: Fit, records: Sequence[Record]) -> None:
        self._baseline, self._records = baseline, records
        self._known: list[tuple[Explanation, Fit, bool]] = []

    def first(self, choices: list[Choice]) -> Choice | None:
        """The first of the findings that does; what was found beside it falls with it."""
        before = self._baseline
        for choice in choices:
            if choice.chosen.by_current <= 0.0 and self._shows(choice.chosen, before):
                return choice
            before = choice.chosen.fit
        return None

    def _shows(self, found: Explanation, before: Fit) -> bool:
        for one, beside, known in self._known:
            if one is found and beside is before:
                return known
        shows = rounding_shows(found, before, self._records)
        self._known.append((found, before, shows))
        return shows


def _without_last(kept: list[Choice]) -> list[Choice]:
    """The findings without the last one, in whose place comes the next of what it was not told from (but for
    its twin, which is the same fit, and where the others were behind and merely predicted the same)."""
    last = kept[-1]
    others = [
        (e, p) for e, p in last.others if (e.gain, e.held_out) != (last.chosen.gain, last.chosen.held_out)
    ]
    if not last.left_open or not others:
        return kept[:-1]
    total = sum(p for _, p in others)
    (chosen, share), *rest = others
    return [*kept[:-1], Choice(chosen, share / total, tuple((e, p / total) for e, p in rest))]


def _instead_of(first: Choice, other: Choice) -> bool:
    """Whether ``other`` has taken the place of ``first``."""
    return any(e is other.chosen for e, _ in first.others)


def _objection(
    choice: Choice,
    so_far: Fit,
    baseline: Fit,
    baseline_there: Fit,
    before: tuple[float, float],
    estimation: Sequence[Record],
    validation: Sequence[Record],
    percent: Callable[[Model], Sequence[float]],
    corroborated: Corroborated,
) -> tuple[str, str | None] | None:
    """What speaks against a finding, in words, and when it shows (see `Doubt`).

    ``so_far``: the fit without it; ``baseline_there``: the baseline with the validation recordings' noise
    levels; ``before``: its colour.
    """
    if choice.chosen.by_current > 0.0:
        return None  # seen in the currents, on both kinds of recordings
    fit = choice.chosen.fit
    there = held_out_fit(fit, validation, [fit.noise])
    effect = choice.chosen.effect
    head = f"{effect.location}.{effect.effect}."
    # Other recordings may not determine all of the structure: it stays as well known as it was.
    own = tuple(name for name in fit.free if name.startswith(head))
    again = fit_whole(fit.model, there.noise, validation, free=fit.free, known=known_beside(fit, own))
    here, elsewhere = fit.model.parameter_values(), again.model.parameter_values()
    std, std_there = standard_errors(fit), standard_errors(again)
    for parameter in effect.entry.parameters:
        name = head + parameter.name
        if name not in fit.free or parameter.default is not None or parameter.neutral is None:
            continue
        a, b = here[name] - parameter.neutral, elsewhere[name] - parameter.neutral
        error = float(np.hypot(std.get(name, 0.0), std_there.get(name, 0.0)))
        if abs(a - b) > OTHER_SIZE * max(abs(a), abs(b)) and abs(a - b) > OTHER_SIZE_ERRORS * error > 0.0:
            why = (
                f"fitted to the other recordings, {effect.effect} has another {parameter.name}: "
                f"{elsewhere[name]:.3g} instead of {here[name]:.3g} {parameter.unit}"
            )
            return why, None
    changing = _changing(fit, again, effect, estimation, validation)
    if changing is not None:
        what, share = changing
        why = (
            f"the size of {effect.effect} would change with the {what}, by {100 * abs(share):.0f} % of its "
            "mean per standard deviation of that"
        )
        return why, what
    after = colour(fit, estimation), colour(there, validation)
    with_it = [(fit, estimation), (there, validation)]
    white = min(after) <= WHITE or _by_steps(after, with_it)
    if not white and not corroborated(fit, so_far, effect):
        why = (
            f"only one-step predictions speak for {effect.effect}, and their errors stay correlated with it; "
            "neither free-run simulations nor the torques bear it out"
        )
        return why, None
    error_before, error_after = (100.0 - np.array(percent(m)) for m in (baseline.model, fit.model))
    if np.any(error_after < (1.0 - CLEARLY_BETTER) * error_before):
        return None
    unchanged = min(after) > COLOURED and all(a > UNCHANGED * b for a, b in zip(after, before, strict=True))
    if unchanged and _more_coloured(after, with_it):
        return f"with {effect.effect} the observer keeps correcting much as it did without", None
    unsteady = unsteadiness(with_it)
    if unsteady > UNSTEADY and unsteady > AS_UNSTEADY * unsteadiness(
        [(baseline, estimation), (baseline_there, validation)]
    ):
        without = held_out_fit(so_far, validation, [there.noise])
        if all_the_time(so_far, fit, estimation) and all_the_time(without, there, validation):
            return None
        return f"something acts at some times and not at others, with {effect.effect} as without", "time"
    return None
