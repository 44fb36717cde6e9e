"""One round of the search: which single further effect explains the recordings best?"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit, fit_parameters
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.tuning import tune_noise

from .candidates import candidates, companion, larger_starts
from .material import material
from .scales import Scales
from .screen import Screened, best_per_effect, screen

#: Least promised gain (nats) that a re-fit is spent on, and the most re-fits of a round.
_WORTH_A_FIT = 6.0
_MOST_FITS = 12
#: Explanations that are fitted a second time from a quiet noise model.
_MOST_QUIET = 4
#: Gain (nats) from which a nuisance is kept.
_WORTH_A_NUISANCE = 8.0


@dataclass(frozen=True)
class Explanation:
    """A model with one more effect, fitted to the estimation recordings.

    ``gain``: nats it is better there than the model without the effect; ``held_out``: the same on the
    validation recordings, the model kept as it was fitted; ``material``: see ``material.py``;
    ``effect_index``: which of the model's effects it is.
    """

    fit: Fit
    gain: float
    held_out: float
    material: bool
    effect_index: int

    @property
    def effect(self) -> Effect:
        return self.fit.model.effects[self.effect_index]

    @property
    def score(self) -> float:
        """Nats in all, less what further parameters gain by chance on data they were fitted to."""
        return self.gain + self.held_out - len(self.effect.parameters)


def explore(
    fit: Fit,
    lab: Model,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    progress: Callable[[str], None] | None = None,
) -> list[Explanation]:
    """Explanations by one further effect, best first (material ones before others).

    ``fit``: the model so far, fitted; ``lab``: the same effects with the structure's parameters as they were
    believed, which lie nearer the truth than fitted ones where those have swallowed a large effect.
    """
    say = progress or (lambda text: None)
    say("screening all effects")
    screened = screen(fit, estimation, candidates(fit.model, estimation, scales))
    chosen = [s for s in best_per_effect(screened) if s.gain > _WORTH_A_FIT][:_MOST_FITS]
    fits: list[Fit] = []
    for s in chosen:
        say(f"fitting {s.effect.effect} at {s.effect.location}")
        best = refit(fit, lab, s, estimation, scales)
        if best is not None:
            fits.append(best)
    fits.sort(key=lambda f: -f.log_likelihood)
    for i, candidate in enumerate(fits[:_MOST_QUIET]):
        say(f"once more {candidate.model.effects[len(fit.model.effects)].effect}")
        again = from_quiet(candidate, estimation)
        if again.log_likelihood > candidate.log_likelihood:
            fits[i] = again
    say("judging on recordings that were not fitted")
    before = held_out_likelihood(fit, validation)
    index = len(fit.model.effects)
    found = [
        Explanation(
            f,
            f.log_likelihood - fit.log_likelihood,
            held_out_likelihood(f, validation) - before,
            material(f.model.effects[index], scales),
            index,
        )
        for f in fits
    ]
    return sorted(found, key=lambda e: (not e.material, -e.score))


def held_out_likelihood(fit: Fit, records: Sequence[Record]) -> float:
    """Log-likelihood of other recordings: the model as it was fitted, the noise levels as these recordings
    have them.

    Levels carried over would judge the noise, not the physics: a disturbance may be larger on another day,
    and a model that leaves nothing unexplained has levels near zero, under which the smallest further effect
    is a catastrophe.
    """
    return tune_noise(pack(fit.model), fit.noise, records, factor=4.0, rounds=2)[1]


def refit(fit: Fit, lab: Model, screened: Screened, records: Sequence[Record], scales: Scales) -> Fit | None:
    """All parameters and the noise levels with the effect inside, from its start or a larger one; None if no
    start predicts anything."""
    trials = [_trial(fit.model, screened.effect, fit.noise, records)]
    for effect in larger_starts(screened.effect, scales):
        for noise in (fit.noise, _quiet(fit.noise)):
            trials.append(_trial(lab, effect, noise, records))
    trials = [t for t in trials if np.isfinite(t.log_likelihood)]
    if not trials:
        return None
    best = polish(max(trials, key=lambda t: t.log_likelihood), records)
    extra = companion(fit.model, screened.effect)
    if extra is not None:
        wider = polish(_trial(best.model, extra, best.noise, records), records)
        if wider.log_likelihood > best.log_likelihood + _WORTH_A_NUISANCE:
            return wider
    return best


def _trial(model: Model, effect: Effect, noise: NoiseModel, records: Sequence[Record]) -> Fit:
    return fit_parameters(model.with_effects(effect), noise, records, iterations=8)


def _quiet(noise: NoiseModel) -> NoiseModel:
    return noise.scaled(motor_torque=0.2, arm_torque=0.2)


def from_quiet(fit: Fit, records: Sequence[Record]) -> Fit:
    """The fit repeated from a noise model with little disturbance.

    Where much was unexplained the noise model has taken it over; in such noise a good explanation looks
    hardly better than none, and the fit stays where it is.
    """
    return polish(fit_parameters(fit.model, _quiet(fit.noise), records, iterations=10), records)


def polish(fit: Fit, records: Sequence[Record], rounds: int = 3) -> Fit:
    """Noise levels and parameters in turn, until neither gains."""
    for _ in range(rounds):
        before = fit.log_likelihood
        noise, _ = tune_noise(pack(fit.model), fit.noise, records, factor=2.0, rounds=1)
        fit = fit_parameters(fit.model, noise, records, iterations=8)
        if fit.log_likelihood - before < 2.0:
            break
    return fit
