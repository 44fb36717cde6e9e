"""One round of the search: which single further effect explains the recordings best?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.records import Record, thinned_to
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ...evidence.held_out import judged
from ...evidence.inverse_dynamics.late_channels import late_channels
from ...evidence.whiteness import colour
from ...hypotheses.candidates import Scanned, contacts, larger_starts
from ...hypotheses.explanation import Explanation
from ...hypotheses.material import material
from ...hypotheses.twins import twins
from ...inputs.scales import Scales, within_reach
from ...policy import CANNOT_TELL, WORTH_ALL_SAMPLES
from ...starts.forms import richer_forms
from ...starts.plain import plain
from ...starts.screen import Screened
from ...starts.shadows import with_shadows
from ...starts.shortlist import shortlist
from ...starts.trials import (
    LAST_STEPS,
    TUNING_STEPS,
    best_of_each,
    better_baseline,
    finished,
    polish,
    quiet,
    trial,
    with_companion,
    with_contact,
)
from .decide import may_be_chosen

#: Trials under each noise model whose levels are tuned: the best, and those that promised most; explanations
#: that are fitted to the end, and those whose end is a new start for the model without them.
_MOST_TUNED = 6
_MOST_PROMISED = 3
_MOST_POLISHED = 6
_MOST_ABLATED = 2
#: The best of them, which go on where they have come to the end of their steps and not of their way.
_MOST_FINISHED = 3
#: Nats behind the best on thinned recordings, both fitted to the end there, from which nothing is expected.
_HOPELESS = 60.0
#: Fits from nothing that are fitted to the end, on all samples.
_MOST_FROM_NOTHING = 3
#: Colour that the best explanation leaves (25 in the mean where there is none, 53 once in a thousand) from
#: which effects are fitted from nothing, too.
_COLOURED = 60.0
#: Gain (nats) of the model without them from which everything is done again from there ...
_ANOTHER_HOLLOW = 10.0
#: ... unless an explanation still gains this much.
_STANDS = 30.0


def explore(
    fit: Fit,
    lab: Model,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    progress: Callable[[str], None] | None = None,
    again: bool = True,
    shifted: Scanned | None = None,
    further: bool = False,
) -> tuple[Fit, list[Explanation]]:
    """The model so far, better fitted where a rival showed the way, and explanations by one further effect,
    best first (material ones before others).

    ``fit``: the model so far, fitted; ``lab``: the same effects with the structure's parameters as they were
    believed, which lie nearer the truth than fitted ones where those have swallowed a large effect;
    ``shifted``: see `late_channels`, where that is known already; ``further``: others were found before.
    """
    say = progress or (lambda text: None)
    limits = within_reach(lab, scales)
    shifted = late_channels(lab, estimation) if shifted is None else shifted
    trials = _tried(fit, lab, estimation, scales, limits, again, shifted, say)
    few, near = trials.few, trials.near
    index = len(fit.model.effects)

    def to_the_end(trial: Fit) -> Fit:
        say(f"fitting {trial.model.effects[index].effect} to the end")
        return with_companion(polish(trial, estimation, limits), fit.model, estimation, limits)

    def ended(trials: Sequence[Fit]) -> list[Fit]:
        trials = [with_contact(t) for t in trials]
        if few is not estimation:
            trials = side_by_side(lambda t: polish(t, few, limits), trials)
            trials = _in_the_running(trials, near.log_likelihood + WORTH_ALL_SAMPLES)
        return side_by_side(to_the_end, trials)

    begun = _most_material(trials.tuned, index, scales)
    fits = best_of_each(ended(begun), index)
    if colour((fits or [fit])[0], estimation) > _COLOURED:
        found = best_of_each(plain(lab, few, scales, limits, say), index)
        rest = found[_MOST_FROM_NOTHING:] if few is estimation else []
        fits += ended(found[:_MOST_FROM_NOTHING])
        fits = best_of_each(_most_material([*fits, *rest], index, scales), index)
    say("fitting richer forms")
    fits = best_of_each([*fits, *ended(richer_forms(fits, fit, index, few, scales, limits))], index)
    ahead = side_by_side(lambda f: finished(f, estimation, limits), fits[:_MOST_FINISHED])
    fits = best_of_each([*ahead, *fits[_MOST_FINISHED:]], index)
    fits = with_shadows(fits, fit, estimation, limits)
    say("fitting the model without them again")
    better = better_baseline(fit, (fits or begun)[:_MOST_ABLATED], estimation, limits)
    moved = better.log_likelihood > fit.log_likelihood + _ANOTHER_HOLLOW
    stands = bool(fits) and fits[0].log_likelihood > better.log_likelihood + _STANDS
    if again and not fit.model.effects and moved and not stands:
        return explore(better, lab, estimation, validation, scales, progress, False, shifted, further)
    fit = better
    say("judging on recordings that were not fitted")
    found = judged(fit, fits, estimation, validation, scales)
    best = next((e for e in found if may_be_chosen(e, further) and not e.effect.entry.unnamed), None)
    late = [] if best is None else trials.as_promising(best, [*begun, *fits])
    if not late:
        return fit, found
    say("fitting what promised as much")
    more = ended(_most_material(late, index, scales))
    more = side_by_side(lambda f: finished(f, estimation, limits), more)
    fit = better_baseline(fit, best_of_each(more, index)[:_MOST_ABLATED], estimation, limits)
    return fit, judged(fit, best_of_each([*fits, *more], index), estimation, validation, scales)


def _most_material(fits: Sequence[Fit], index: int, scales: Scales) -> list[Fit]:
    """The best of the fits, one of each effect at each place: what is too small or too much like a simpler
    thing to be named takes no place from what is not."""
    best = best_of_each(fits, index)  # by likelihood, which the sort below keeps

    def told_small(fit: Fit) -> bool:
        return not material(fit.model.effects[index], scales.driven(fit.model))

    return sorted(best, key=told_small)[:_MOST_POLISHED]


def _in_the_running(fits: Sequence[Fit], least: float) -> list[Fit]:
    """Fits on thinned recordings with a log-likelihood of at least ``least``, without those so far behind the
    best that all samples cannot turn it; a best one and a runner-up at least."""
    ranked = sorted((f.log_likelihood for f in fits), reverse=True)
    near_the_best = min([ranked[0] - _HOPELESS, *ranked[1:2]]) if ranked else 0.0
    return [f for f in fits if f.log_likelihood >= max(near_the_best, least)]


@dataclass(frozen=True)
class _Trials:
    """Trials of the effects worth one: the ``tuned`` ones go on; ``under``: all of them, under either noise
    model; ``few``: the recordings they were made on, thinned where they are long, and ``near``: the model so
    far on these."""

    tuned: list[Fit]
    under: list[list[Fit]]
    few: Sequence[Record]
    near: Fit

    def as_promising(self, best: Explanation, ended: Sequence[Fit]) -> list[Fit]:
        """Trials of effects that are not among the ``ended`` fits, and that came as far as the ``best`` one's
        trial under the noise model under which that came farther, but for what recordings need to tell two
        apart. What they cannot tell from it stands beside it, even where more of what other recordings refuse
        was ahead and was fitted first."""

        def key(fit: Fit) -> tuple[str, str]:
            return _name(fit.model.effects[best.effect_index])

        def own(trials: Sequence[Fit]) -> float:
            return max((t.log_likelihood for t in trials if key(t) == _name(best.effect)), default=-np.inf)

        trials = max(self.under, key=own)
        least = own(trials) - CANNOT_TELL
        if not np.isfinite(least):
            return []
        known = {_name(best.effect), *map(_name, twins(best.effect, best.fit.model.rigid)), *map(key, ended)}
        return [t for t in trials if t.log_likelihood > least and key(t) not in known]


def _name(effect: Effect) -> tuple[str, str]:
    return effect.effect, effect.location


def _tried(
    fit: Fit,
    lab: Model,
    estimation: Sequence[Record],
    scales: Scales,
    limits: Limits,
    first: bool,
    shifted: Scanned,
    say: Callable[[str], None],
) -> _Trials:
    """The best trials of the effects worth one."""
    say("screening all effects")
    few = thinned_to(estimation)
    near = fit
    if few is not estimation:
        near = fit_whole(fit.model, fit.noise, few, free=fit.free, iterations=LAST_STEPS, limits=limits)
        if not np.isfinite(near.log_likelihood):
            near, few = fit, estimation
    chosen = shortlist(near, few, scales, limits, first and not fit.model.effects, shifted)
    noises = (near.noise, quiet(near.noise))

    def along(job: tuple[int, list[int]]) -> list[list[Fit]]:
        which, chain = job
        ends: list[list[Fit]] = []
        touched: float | None = None
        for s in (chosen[which][i] for i in chain):
            say(f"fitting {s.effect.effect} at {s.effect.location}")
            starts = contacts(s.effect, scales, touched)
            best = trial(near, lab, starts, larger_starts(s.effect, scales), few, noises[which], limits)
            ends.append(best)
            if len(starts) > 1 and best and s.effect.entry.contact in best[0].model.effects[-1].parameters:
                # One contact for all forms of friction at a place.
                touched = best[0].model.effects[-1].parameters[s.effect.entry.contact]
        return ends

    jobs = [(which, chain) for which in (0, 1) for chain in _chains(chosen[which])]
    ended: dict[tuple[int, int], list[Fit]] = {}
    for (which, chain), ends in zip(jobs, side_by_side(along, jobs), strict=True):
        ended |= {(which, i): best for i, best in zip(chain, ends, strict=True)}
    worth: list[Fit] = []
    under: list[list[Fit]] = []
    for which in (0, 1):
        trials: list[Fit] = []
        promised: list[Fit] = []
        for i in range(len(chosen[which])):
            best = ended[which, i]
            trials += best
            if len(promised) < _MOST_PROMISED:
                promised += best
        trials.sort(key=lambda t: -t.log_likelihood)
        # What promised most gets its levels, too: a few steps may be too few where the structure's parameters
        # have gone far to make up for it.
        late = [t for t in promised if all(t is not other for other in trials[:_MOST_TUNED])]
        worth += [*trials[:_MOST_TUNED], *late]
        under.append(trials)
    return _Trials(side_by_side(lambda t: polish(t, few, limits, TUNING_STEPS), worth), under, few, near)


def _chains(promising: Sequence[Screened]) -> list[list[int]]:
    """Places in the list of what is tried one after another, the longest first: forms of dry friction at one
    place, of which the first finds the contact of all; any other effect alone."""
    chains: dict[str | int, list[int]] = {}
    for i, s in enumerate(promising):
        chains.setdefault(s.effect.location if s.effect.entry.contact else i, []).append(i)
    return sorted(chains.values(), key=len, reverse=True)
