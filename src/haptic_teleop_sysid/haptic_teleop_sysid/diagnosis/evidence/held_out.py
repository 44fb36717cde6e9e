"""Explanations judged by recordings that were not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import likelihood_of
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.records import Record, thinned_to
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

from ..hypotheses.explanation import Explanation
from ..hypotheses.material import material
from ..inputs.scales import Scales
from ..policy import CLEAR_GAIN
from .by_blocks import by_blocks

#: Best fits whose noise levels the model without their effect is granted, too.
_MOST_LENDING = 2
#: Gain (nats) on the estimation recordings from which a loss on others is not believed before the noise
#: levels were sought from everywhere.
_GAINS = 10.0
_STEPS = 15
#: Steps from every start, and how many of those that are ahead then go on.
_FIRST_STEPS, _MOST_ENDED = 4, 2
#: Share of the samples that a search takes on the way to noise levels, which are six numbers at most.
_FEWER = 0.5
#: Share of an effect's gain that the structure's parameters beside it may lose on recordings that it does not
#: reach.
_BY_THE_STRUCTURE = 0.05
#: Nats that an effect changes on recordings that it does not reach, but for rounding.
_NOTHING = 0.01
#: Nats by which the noise levels of another model must be better.
_A_HOLLOW = 1.0


def judged(
    fit: Fit,
    fits: Sequence[Fit],
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    *,
    known: Sequence[float] = (),
) -> list[Explanation]:
    """The fits to the estimation recordings as explanations beside ``fit``, best first (material ones before
    others); ``known``: what speaks for each on these already, nats, where anything does."""
    if not fits:
        return []
    levels = [fit.noise, *(f.noise for f in fits[:_MOST_LENDING]), *noise_starts(fit.model, validation)]
    before = held_out_fit(fit, validation, levels)
    after = side_by_side(lambda f: held_out_fit(f, validation, [f.noise, before.noise]), fits)
    for i, (f, there) in enumerate(zip(fits, after, strict=True)):
        if f.log_likelihood > fit.log_likelihood + _GAINS and there.log_likelihood < before.log_likelihood:
            again = held_out_fit(f, validation, noise_starts(f.model, validation))
            after[i] = max(there, again, key=lambda one: one.log_likelihood)
    if after:
        # Levels that a rival found are good enough for the model without it.
        best = max(after, key=lambda f: f.log_likelihood)
        before = max(before, held_out_fit(fit, validation, [best.noise]), key=lambda f: f.log_likelihood)
    index = len(fit.model.effects)
    both = [(fit, before), *zip(fits, after, strict=True)]
    between = all_reconciled(both, validation)
    levelled = [(f, replace(t, noise=noise)) for (f, t), (_, noise) in zip(both, between, strict=True)]
    blocks = side_by_side(lambda one: by_blocks([(one[0], estimation), (one[1], validation)]), levelled)
    alone = between[0][0]
    found = []
    known = known or [0.0] * len(fits)
    for f, there, (beside, _), own, clear in zip(fits, after, between[1:], blocks[1:], known, strict=True):
        gain = f.log_likelihood - fit.log_likelihood
        held_out, reconciled_more = there.log_likelihood - before.log_likelihood, beside - alone
        loss = -(held_out + reconciled_more)
        clear += gain
        slight = clear >= CLEAR_GAIN and 0.0 < loss < _BY_THE_STRUCTURE * clear
        if slight and _unreached(there, index, validation):
            held_out = reconciled_more = 0.0
        found.append(
            Explanation(
                f,
                gain,
                held_out,
                material(f.model.effects[index], scales.driven(f.model)),
                index,
                reconciled_more,
                gains=None if own is None or blocks[0] is None else own - blocks[0],
            )
        )
    return sorted(found, key=lambda e: (not e.material, -e.score))


def _unreached(there: Fit, index: int, records: Sequence[Record]) -> bool:
    """Whether the recordings are predicted alike with an effect and without it, all else the same.

    They do not object to a stop that they do not reach. What they lose beside it they lose by the structure's
    parameters, which a fit that leaves less unexplained holds more tightly."""
    own = there.model.effects[index]
    bare = there.model.without(own.effect, own.location)
    without = likelihood_of(pack(bare), there.noise, records)
    return abs(without - there.log_likelihood) < _NOTHING


def all_reconciled(
    both: Sequence[tuple[Fit, Fit]], records: Sequence[Record]
) -> list[tuple[float, NoiseModel]]:
    """What fits gain on other recordings where they are `reconciled` with what they are there, nats, and the
    noise levels that they have there: those of the best one where they are better with these, because a
    search for levels may end in a hollow, which is none of the physics."""
    first = side_by_side(lambda pair: reconciled(*pair, records), both)
    levels = max(first, key=_likelihood).noise

    def again(one: tuple[tuple[Fit, Fit], Fit]) -> tuple[float, NoiseModel]:
        (fit, there), found = one
        if not np.isfinite(there.log_likelihood):
            return 0.0, there.noise
        own, with_these = (likelihood_of(pack(found.model), n, records) for n in (found.noise, levels))
        if not with_these > own + _A_HOLLOW:
            return max(found.log_likelihood - there.log_likelihood, 0.0), there.noise
        better = max(found, reconciled(fit, replace(found, noise=levels), records), key=_likelihood)
        return max(better.log_likelihood - there.log_likelihood, 0.0), levels

    return side_by_side(again, zip(both, first, strict=True))


def _likelihood(fit: Fit) -> float:
    return fit.log_likelihood


def reconciled(fit: Fit, there: Fit, records: Sequence[Record]) -> Fit:
    """The fit to these recordings from where ``there`` is, when what ``fit`` knows of its parameters counts
    beside them; ``there`` itself where it knows nothing.

    What it gains both kinds of recordings gain when the parameters may lie between what either wants. A
    parameter that the estimation recordings hardly determine (the angle at which a weak spring rests, a
    motor's inertia under a slow chirp) would otherwise count for or against an effect by the chance of where
    it ended. A fit and no single step, because such parameters go far.
    """
    kept = [i for i, n in enumerate(fit.free) if n not in fit.at_bound and fit.information[i, i] > 0.0]
    known = fit.information[np.ix_(kept, kept)]
    if not np.all(np.isfinite(known)) or not np.isfinite(there.log_likelihood):
        return there
    free = tuple(fit.free[i] for i in kept)
    return fit_whole(fit.model, there.noise, records, free=free, known=known, iterations=_STEPS)


def with_both_kinds(
    fit: Fit, estimation: Sequence[Record], validation: Sequence[Record]
) -> list[tuple[Fit, Sequence[Record]]]:
    """A fit with the recordings of either kind, and their noise levels; the same is free in both."""
    there = replace(held_out_fit(fit, validation, [fit.noise]), free=fit.free)
    return [(fit, estimation), (there, validation)]


def held_out_fit(fit: Fit, records: Sequence[Record], levels: Sequence[NoiseModel]) -> Fit:
    """Other recordings under the model as it was fitted, with the noise levels as these recordings have them,
    sought from all of ``levels``.

    Levels carried over would judge the noise, not the physics: a disturbance may be larger on another day,
    and a model that leaves nothing unexplained has levels near zero, under which the smallest further effect
    is a catastrophe.  The way there is made on thinned recordings where they are long.
    """
    return fit.once(("held out", *levels), records, lambda: _held_out_fit(fit, records, levels))


def _held_out_fit(fit: Fit, records: Sequence[Record], levels: Sequence[NoiseModel]) -> Fit:
    few = thinned_to(records, _FEWER)

    def onward(noise: NoiseModel, steps: int) -> Fit:
        return fit_whole(fit.model, noise, few, free=(), iterations=steps)

    begun = side_by_side(lambda noise: onward(noise, _FIRST_STEPS), levels)
    ahead = sorted(begun, key=lambda one: -one.log_likelihood)[:_MOST_ENDED]

    def to_the_end(one: Fit) -> Fit:
        return one if one.converged else onward(one.noise, _STEPS)

    ends = side_by_side(to_the_end, ahead)
    best = max(ends, key=lambda end: end.log_likelihood)
    if few is records:
        return best
    return fit_whole(fit.model, best.noise, records, free=(), iterations=_STEPS)
