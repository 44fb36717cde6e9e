"""Fits of a model with one more effect: a few steps from many starts, then the best to the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..hypotheses.candidates import companion

#: Correlation time of a disturbance that is soon forgotten, s.
_SOON = 0.02
#: Gauss-Newton steps of a trial, of one whose noise levels are fitted with it, and of a fit to the end.
_TRIAL_STEPS = 5
#: Nats that a step must promise: what decides is larger by far.
_ENOUGH = 1.0
TUNING_STEPS = 3
LAST_STEPS = 15
#: How often a fit goes on from where its steps ended.
_MOST_ROUNDS = 4
#: Gain (nats) from which a nuisance is kept.
_WORTH_A_NUISANCE = 8.0


def quiet(noise: NoiseModel) -> NoiseModel:
    """Weak disturbances that are soon forgotten: strong or lasting ones take up what an effect explains."""
    return replace(
        noise.scaled(motor_torque=0.2, arm_torque=0.2),
        motor_time=min(noise.motor_time, _SOON),
        arm_time=min(noise.arm_time, _SOON),
    )


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
    trials += [_trial(lab, _in_currents(e, fit.model, lab), noise, records, limits) for e in large]
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


def _in_currents(effect: Effect, of: Model, to: Model) -> Effect:
    """A limit or a dead band at the same current in a model with another torque constant."""
    if effect.entry.kind != "input":
        return effect
    factor = to.parameters["torque_constant"] / of.parameters["torque_constant"]
    values = dict(effect.parameters)
    for p in effect.entry.parameters:
        if p.unit == "N*m" and p.name in values:
            values[p.name] = p.within(values[p.name] * factor)
    return Effect(effect.effect, effect.location, values)


def _trial(model: Model, effect: Effect, noise: NoiseModel, records: Sequence[Record], limits: Limits) -> Fit:
    wider = model.with_effects(effect)
    if (contact := effect.entry.contact) in effect.parameters:
        wider = replace(wider, fixed=(*wider.fixed, f"{effect.location}.{effect.effect}.{contact}"))
    return fit_parameters(wider, noise, records, iterations=_TRIAL_STEPS, tolerance=_ENOUGH, limits=limits)


def polish(fit: Fit, records: Sequence[Record], limits: Limits, steps: int = LAST_STEPS) -> Fit:
    """The fit with its noise levels free as well, ``steps`` further."""
    return fit_whole(
        fit.model, fit.noise, records, free=fit.free, iterations=steps, enough=_ENOUGH, limits=limits
    )


def finished(fit: Fit, records: Sequence[Record], limits: Limits) -> Fit:
    """The fit, or where it stopped at the limit of its steps the end of its way: the likelihood of a late
    encoder has a kink at every sample, and its structure may have far to go."""
    gained = np.inf
    for _ in range(_MOST_ROUNDS if not fit.converged else 0):
        if not gained > _ENOUGH:
            break
        further = polish(fit, records, limits)
        gained = further.log_likelihood - fit.log_likelihood
        fit = further if gained > 0.0 else fit
    return fit


def with_contact(fit: Fit) -> Fit:
    """The fit with the contact of its last effect free: a trial holds it where it started, because
    friction that is too small yet says nothing of it; one off by a factor of three leaves colour behind."""
    effect = fit.model.effects[-1]
    name = f"{effect.location}.{effect.effect}.{effect.entry.contact}"
    if name not in fit.model.fixed:
        return fit
    model = replace(fit.model, fixed=tuple(n for n in fit.model.fixed if n != name))
    return replace(fit, model=model, free=model.free_parameters())


def with_companion(fit: Fit, before: Model, records: Sequence[Record], limits: Limits) -> Fit:
    """``fit``, or the same with the nuisance that its effect may call for, where that gains enough."""
    extra = companion(before, fit.model.effects[len(before.effects)])
    if extra is None or extra.effect in {e.effect for e in fit.model.effects}:
        return fit
    wider = fit_whole(fit.model.with_effects(extra), fit.noise, records, iterations=LAST_STEPS, limits=limits)
    return wider if wider.log_likelihood > fit.log_likelihood + _WORTH_A_NUISANCE else fit


def best_of_each(fits: Sequence[Fit], index: int) -> list[Fit]:
    """The best fit of each effect at each place, best first; none that predicts nothing."""
    best: dict[tuple[str, str], Fit] = {}
    for f in fits:
        if not np.isfinite(f.log_likelihood):
            continue
        key = (f.model.effects[index].effect, f.model.effects[index].location)
        if key not in best or f.log_likelihood > best[key].log_likelihood:
            best[key] = f
    return sorted(best.values(), key=lambda f: -f.log_likelihood)


def better_baseline(fit: Fit, fits: Sequence[Fit], records: Sequence[Record], limits: Limits) -> Fit:
    """``fit``, or the same structure fitted from where the rivals ended, without their effect: what a rival
    gains only by having come out of a hollow is none of its effect's.
    """
    count, free = len(fit.model.effects), fit.free

    def bare(rival: Fit) -> Fit:
        model = replace(rival.model, effects=rival.model.effects[:count], fixed=fit.model.fixed)
        return fit_whole(model, rival.noise, records, free=free, iterations=LAST_STEPS, limits=limits)

    best = fit
    for again in side_by_side(bare, fits):
        if again.log_likelihood > best.log_likelihood + 1.0:
            best = again
    return best
