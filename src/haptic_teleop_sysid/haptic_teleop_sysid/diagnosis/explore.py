"""One round of the search: which single further effect explains the recordings best?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit, Limits, fit_parameters
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

from .candidates import candidates, companion, contacts, larger_starts
from .material import material
from .scales import Scales, within_reach
from .scan import both, scan
from .screen import Screened, best_per_effect, screen

#: Least promised gain (nats) that a re-fit is spent on, the most re-fits of a round under each noise model,
#: and how many of the best under the other one are among them.
_WORTH_A_FIT = 6.0
_MOST_FITS = 8
_BEST_OF_THE_OTHER = 3
#: Correlation time of a disturbance that is soon forgotten, s.
_SOON = 0.02
#: Starts of one effect that are screened under both noise models.
_STARTS_ONCE_MORE = 3
#: Gauss-Newton steps of a trial, of one whose noise levels are fitted with it, and of a fit to the end.
_TRIAL_STEPS = 5
_TUNING_STEPS = 3
_LAST_STEPS = 15
#: Trials under each noise model whose levels are tuned, explanations that are fitted to the end, and those
#: whose end is a new start for the model without them.
_MOST_TUNED = 6
_MOST_POLISHED = 6
_MOST_ABLATED = 2
#: Gain (nats) of the model without them from which everything is done again from there ...
_ANOTHER_HOLLOW = 10.0
#: ... unless an explanation still gains this much.
_STANDS = 30.0
#: Gain (nats) from which a nuisance is kept.
_WORTH_A_NUISANCE = 8.0


@dataclass(frozen=True)
class Explanation:
    """A model with one more effect, fitted to the estimation recordings.

    ``gain``: nats it is better there than the model without the effect; ``held_out``: the same on the
    validation recordings, the model kept as it was fitted; ``material``: see ``material.py``;
    ``effect_index``: which of the model's effects it is.  ``by_current``: how many of these nats (both kinds)
    the measured current gives; ``std``: uncertainty of a parameter that the current determined; ``beside``:
    an effect of the recorded current alone, which the model, driven by the command, has no need of.
    """

    fit: Fit
    gain: float
    held_out: float
    material: bool
    effect_index: int
    by_current: float = 0.0
    std: dict[str, float] = field(default_factory=dict)
    beside: Effect | None = None

    @property
    def effect(self) -> Effect:
        return self.fit.model.effects[self.effect_index] if self.beside is None else self.beside

    @property
    def score(self) -> float:
        """Nats in all, less what further parameters gain by chance on data they were fitted to."""
        return self.gain + self.held_out - len(self.effect.parameters)

    @property
    def by_motion(self) -> float:
        """The score without what the measured current gives."""
        return self.score - self.by_current


def explore(
    fit: Fit,
    lab: Model,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    progress: Callable[[str], None] | None = None,
    again: bool = True,
) -> tuple[Fit, list[Explanation]]:
    """The model so far, better fitted where a rival showed the way, and explanations by one further effect,
    best first (material ones before others).

    ``fit``: the model so far, fitted; ``lab``: the same effects with the structure's parameters as they were
    believed, which lie nearer the truth than fitted ones where those have swallowed a large effect.
    """
    say = progress or (lambda text: None)
    say("screening all effects")
    limits = within_reach(lab)
    chosen = shortlist(fit, estimation, scales, limits, again and not fit.model.effects)
    fits: list[Fit] = []
    for noise, promising in zip((fit.noise, _quiet(fit.noise)), chosen, strict=True):
        trials: list[Fit] = []
        touched: dict[str, float] = {}
        for s in promising:
            say(f"fitting {s.effect.effect} at {s.effect.location}")
            starts = contacts(s.effect, touched.get(s.effect.location))
            best = trial(fit, lab, starts, larger_starts(s.effect, scales), estimation, noise, limits)
            trials += best
            if len(starts) > 1 and best and "contact_angle" in best[0].model.effects[-1].parameters:
                # One contact for all forms of friction at a place.
                touched[s.effect.location] = best[0].model.effects[-1].parameters["contact_angle"]
        trials.sort(key=lambda t: -t.log_likelihood)
        fits += [polish(t, estimation, limits, _TUNING_STEPS) for t in trials[:_MOST_TUNED]]
    index = len(fit.model.effects)
    # What is too small or too much like a simpler thing to be named takes no place from what is not.
    fits = sorted(
        best_of_each(fits, index),
        key=lambda f: (not material(f.model.effects[index], scales), -f.log_likelihood),
    )
    for i, candidate in enumerate(fits[:_MOST_POLISHED]):
        say(f"once more {candidate.model.effects[index].effect}")
        fits[i] = with_companion(polish(candidate, estimation, limits), fit.model, estimation, limits)
    fits = sorted(fits[:_MOST_POLISHED], key=lambda f: -f.log_likelihood)
    say("fitting the model without them once more")
    better = better_baseline(fit, fits[:_MOST_ABLATED], estimation, limits)
    moved = better.log_likelihood > fit.log_likelihood + _ANOTHER_HOLLOW
    stands = bool(fits) and fits[0].log_likelihood > better.log_likelihood + _STANDS
    if again and not fit.model.effects and moved and not stands:
        return explore(better, lab, estimation, validation, scales, progress, again=False)
    fit = better
    say("judging on recordings that were not fitted")
    return fit, judged(fit, fits, validation, scales)


def judged(fit: Fit, fits: Sequence[Fit], validation: Sequence[Record], scales: Scales) -> list[Explanation]:
    """The fits as explanations beside ``fit``, best first (material ones before others)."""
    levels = [fit.noise, *(f.noise for f in fits[:_MOST_ABLATED]), *noise_starts(fit.model, validation)]
    before = held_out_fit(fit, validation, levels)
    after = [held_out_fit(f, validation, [f.noise, before.noise]) for f in fits]
    for i, (f, there) in enumerate(zip(fits, after, strict=True)):
        if (
            f.log_likelihood > fit.log_likelihood + _ANOTHER_HOLLOW
            and there.log_likelihood < before.log_likelihood
        ):
            again = held_out_fit(f, validation, noise_starts(f.model, validation))
            after[i] = max(there, again, key=lambda one: one.log_likelihood)
    if after:
        # Levels that a rival found are good enough for the model without it.
        best = max(after, key=lambda f: f.log_likelihood)
        before = max(before, held_out_fit(fit, validation, [best.noise]), key=lambda f: f.log_likelihood)
    index = len(fit.model.effects)
    found = [
        Explanation(
            f,
            f.log_likelihood - fit.log_likelihood,
            there.log_likelihood - before.log_likelihood,
            material(f.model.effects[index], scales),
            index,
        )
        for f, there in zip(fits, after, strict=True)
    ]
    return sorted(found, key=lambda e: (not e.material, -e.score))


def shortlist(
    fit: Fit, records: Sequence[Record], scales: Scales, limits: Limits, first: bool
) -> tuple[list[Screened], list[Screened]]:
    """The effects worth a fit, by what a linearisation promises: under the noise model as it was fitted, and
    under a quiet one.

    Where much is unexplained the fitted noise model takes it for a disturbance, under which no effect
    promises much: a delay of 16 ms that a fit explains with hundreds of nats promised less than seven.
    ``first``: the first look, for which both are scanned.
    """
    quiet = fit_parameters(fit.model, _quiet(fit.noise), records, iterations=12, limits=limits)
    scanned = scan(fit, records, scales)
    if first:
        scanned = both(scanned, scan(quiet, records, scales))
    effects = list(candidates(fit.model, records, scales, scanned))
    ranked = []
    for one in (fit, quiet):
        screened = screen(one, records, effects)
        effects = few_of_each(screened, effects)
        ranked.append([s for s in best_per_effect(screened) if s.gain > _WORTH_A_FIT][:_MOST_FITS])
    own, other = ranked
    # The best of either are tried under both.
    return _with_first(own, other), _with_first(other, own)


def _with_first(own: list[Screened], other: list[Screened]) -> list[Screened]:
    known = {(s.effect.effect, s.effect.location) for s in own}
    return own + [s for s in other[:_BEST_OF_THE_OTHER] if (s.effect.effect, s.effect.location) not in known]


def few_of_each(screened: Sequence[Screened], effects: Sequence[Effect]) -> list[Effect]:
    """The starts worth screening once more: the best ones of each effect at each place, and all starts of
    those of which none promised anything."""
    kept: dict[tuple[str, str], int] = {}
    found = []
    for s in screened:
        key = (s.effect.effect, s.effect.location)
        kept[key] = kept.get(key, 0) + 1
        if kept[key] <= _STARTS_ONCE_MORE:
            found.append(s.start)
    return found + [e for e in effects if (e.effect, e.location) not in kept]


def better_baseline(fit: Fit, fits: Sequence[Fit], records: Sequence[Record], limits: Limits) -> Fit:
    """``fit``, or the same structure fitted from where the rivals ended, without their effect: what a rival
    gains only by having come out of a hollow is none of its effect's.
    """
    count, free = len(fit.model.effects), fit.free
    for rival in fits:
        bare = replace(rival.model, effects=rival.model.effects[:count], fixed=fit.model.fixed)
        again = fit_whole(bare, rival.noise, records, free=free, iterations=_LAST_STEPS, limits=limits)
        if again.log_likelihood > fit.log_likelihood + 1.0:
            fit = again
    return fit


def best_of_each(fits: Sequence[Fit], index: int) -> list[Fit]:
    """The best fit of each effect at each place, best first."""
    best: dict[tuple[str, str], Fit] = {}
    for f in fits:
        key = (f.model.effects[index].effect, f.model.effects[index].location)
        if key not in best or f.log_likelihood > best[key].log_likelihood:
            best[key] = f
    return sorted(best.values(), key=lambda f: -f.log_likelihood)


def held_out_fit(fit: Fit, records: Sequence[Record], levels: Sequence[NoiseModel]) -> Fit:
    """Other recordings under the model as it was fitted, with the noise levels as these recordings have them,
    sought from all of ``levels``.

    Levels carried over would judge the noise, not the physics: a disturbance may be larger on another day,
    and a model that leaves nothing unexplained has levels near zero, under which the smallest further effect
    is a catastrophe.
    """
    ends = [fit_whole(fit.model, noise, records, free=(), iterations=_LAST_STEPS) for noise in levels]
    return max(ends, key=lambda end: end.log_likelihood)


def trial(
    fit: Fit,
    lab: Model,
    small: Sequence[Effect],
    large: Sequence[Effect],
    records: Sequence[Record],
    noise: NoiseModel,
    limits: Limits,
) -> list[Fit]:
    """A few steps from an effect's starts, small ones beside fitted parameters and large ones beside believed
    ones: the best, if any predicts anything."""
    trials = [_trial(fit.model, e, noise, records, limits) for e in small]
    trials += [_trial(lab, e, noise, records, limits) for e in large]
    trials = [t for t in trials if np.isfinite(t.log_likelihood)]
    if not trials:
        return []
    best = max(trials, key=lambda t: t.log_likelihood)
    extra = companion(fit.model, best.model.effects[-1])
    if extra is not None:
        wider = fit_parameters(
            best.model.with_effects(extra), noise, records, iterations=_TRIAL_STEPS, limits=limits
        )
        if wider.log_likelihood > best.log_likelihood + _WORTH_A_NUISANCE:
            best = wider
    return [best]


def with_companion(fit: Fit, before: Model, records: Sequence[Record], limits: Limits) -> Fit:
    """``fit``, or the same with the nuisance that its effect may call for, where that gains enough."""
    extra = companion(before, fit.model.effects[len(before.effects)])
    if extra is None or extra.effect in {e.effect for e in fit.model.effects}:
        return fit
    wider = fit_whole(
        fit.model.with_effects(extra), fit.noise, records, iterations=_LAST_STEPS, limits=limits
    )
    return wider if wider.log_likelihood > fit.log_likelihood + _WORTH_A_NUISANCE else fit


def _trial(model: Model, effect: Effect, noise: NoiseModel, records: Sequence[Record], limits: Limits) -> Fit:
    wider = model.with_effects(effect)
    if "contact_angle" in effect.parameters:
        wider = replace(wider, fixed=(*wider.fixed, f"{effect.location}.{effect.effect}.contact_angle"))
    return fit_parameters(wider, noise, records, iterations=_TRIAL_STEPS, limits=limits)


def _quiet(noise: NoiseModel) -> NoiseModel:
    """Weak disturbances that are soon forgotten: strong or lasting ones take up what an effect explains."""
    return replace(
        noise.scaled(motor_torque=0.2, arm_torque=0.2),
        motor_time=min(noise.motor_time, _SOON),
        arm_time=min(noise.arm_time, _SOON),
    )


def polish(fit: Fit, records: Sequence[Record], limits: Limits, steps: int = _LAST_STEPS) -> Fit:
    """The fit with its noise levels free as well, ``steps`` further."""
    return fit_whole(fit.model, fit.noise, records, free=fit.free, iterations=steps, limits=limits)
