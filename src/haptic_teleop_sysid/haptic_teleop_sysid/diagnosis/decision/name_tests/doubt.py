"""Is the named effect really it?  Questions that likelihoods of rivals do not ask.

A name is only as good as its rivals: what stands for physics that no effect describes wins against all of
them and is wrong all the same.  But it gives itself away.  Fitted to other recordings it has another size,
because it imitates; its size follows something that is not in it (`modulation.py`); what the observer
corrects stays predictable from one sample to the next, because the cause still acts (portmanteau test, Ljung
and Box 1978); or the observer is surprised at some times and not at others, because what acts comes and goes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.held_out import held_out_fit
from ...evidence.null_records import heavy_tailed, rounding_shows, with_noisy_input
from ...evidence.whiteness import colour, unsteadiness
from ...hypotheses.explanation import Explanation
from ...policy import COLOURED, ERRS_LESS, ONLY_HERE, UNSTEADY
from ..adequacy import left_size
from ..coloured import by_steps, more_coloured
from ..corroborated import Corroborated
from ..reasons import Doubt, rather_event
from ..search.decide import Choice, significant
from ..search.rounds import SearchResult
from ..stand import Stand, stand_of, stands_out
from .objections import Objections

#: Factor over what noise of a measured input makes the observer add, below which what is left is that noise.
#: Of ten clean recordings without their commands three have 1.1 to 1.5, the others, which random torques
#: shake, 2.1 to 4.6; of three with physics that has no name the least has 2.6, of 17 real joints 2.4.
AS_NOISE = 1.5
#: Share of the input that scatter may be to be noise: of a signal with frequencies up to a fifth of the
#: sampling rate it is 0.15 to 0.2, of white ones all; the benchmark's currents have 0.005 to 0.09.
MOST_NOISE = 0.1


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
        keeps_on = min(before) > COLOURED and more_coloured(before, both)
        if not keeps_on and _noise_of_the_input(result.baseline, [*estimation, *validation]):
            return result, None, stand
        here = [e for e in result.last_round if e.gain > ONLY_HERE and e.material and significant(e)]
        if here:
            best = max(here, key=lambda e: e.gain)
            why = (
                f"with {best.effect.effect} the log-likelihood of the estimation recordings would rise by "
                f"{best.gain:.0f}, but the others do not bear it out"
            )
            return result, rather_event(Doubt(Choice(best, 1.0), why), both), stand
        if keeps_on:
            why = "the observer keeps correcting in one and the same direction"
            return result, rather_event(Doubt(None, why, "throughout"), both), stand
        now_and_then = heavy_tailed(both)
        if unsteadiness(both) > UNSTEADY or now_and_then is not None:
            place = None if now_and_then is None else ("motor", "arm")[now_and_then]
            where = place and result.baseline.model.location(place)
            doubt = Doubt(None, "something acts at some times and not at others", "time", place=where)
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
    rounded = min(before) > COLOURED and by_steps(before, both)
    rounding = _Rounding(result.baseline, estimation, percent)
    objections = Objections(result.baseline, there, before, estimation, validation, percent, corroborated)
    while True:
        while rounded and (steps := rounding.first(kept)) is not None:
            name = steps.chosen.effect.effect
            given_up(steps, f"with encoders this coarse {name} would show on recordings without it, too")
            kept = _without_last(kept[: kept.index(steps) + 1])
        if kept and kept[-1].chosen is not asked:
            so_far = kept[-2].chosen.fit if len(kept) > 1 else result.baseline
            why = objections.to(kept[-1], so_far)
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


def _noise_of_the_input(fit: Fit, records: Sequence[Record]) -> bool:
    """Whether the observer adds less torque than the measured input has noise, and hardly more (AS_NOISE)
    than to simulated recordings in which nothing is hidden, but whose input has that noise: effects then
    follow it. What scatters by more than MOST_NOISE of the input may drive the joint, and is not taken for
    noise."""
    noise = sum(len(r) * r.input_noise**2 for r in records)
    driven = sum(float(r.input @ r.input) for r in records)
    if noise > MOST_NOISE**2 * driven:
        return False
    with suppress(*FAILURES):
        left = left_size(fit, records)
        if left**2 * driven < noise:
            return left < AS_NOISE * left_size(fit, with_noisy_input(fit, records))
    return False


class _Rounding:
    """Which findings stand for the steps of coarse encoders: likelihoods speak for them on simulated
    recordings without them, too, and free runs do not. Every one is asked once."""

    def __init__(
        self, baseline: Fit, records: Sequence[Record], percent: Callable[[Model], Sequence[float]]
    ) -> None:
        self._baseline, self._records, self._percent = baseline, records, percent
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
        shows = not self._errs_less(found.fit, before) and rounding_shows(found, before, self._records)
        self._known.append((found, before, shows))
        return shows

    def _errs_less(self, fit: Fit, before: Fit) -> bool:
        """Whether free runs err less with a finding, by ERRS_LESS: encoder steps are too small for that."""
        own, other = (100.0 - sum(p) / len(p) for p in map(self._percent, (fit.model, before.model)))
        return own < ERRS_LESS * other


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
