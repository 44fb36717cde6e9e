"""Sizes of what the inverse dynamics named, and parameters beside a measured torque, fitted once more to free
runs.

A regression on torques weighs every stretch of the motion alike and knows nothing of where an error of an
inertia leads over seconds; an input that is a little late, or filtered, shifts its sizes together. The model
is handed on to be simulated. So its parameters are fitted to the simulated angles, too, and that is taken
where the other recordings, which neither was fitted to, are simulated clearly better by it.

Dry friction that sticks makes the squared error of a free run rough: where the joint starts from rest or
turns, a hair's breadth of a parameter decides whether it sticks for another sample, every derivative is that
of one facet, and the search ends at the next edge: one recording of a pendulum gave weights from 3.1 to 3.5
N·m, by where the search began. With a sign that is smoothed, over a velocity that is fitted, too, all
of them end at one place. What is handed on sticks, with the sizes found so.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts
from haptic_teleop_sysid.simulation.parameter_fit import ParameterFit

from ...evidence.certainty import standard_errors
from ...evidence.horizons import PERFECT
from ...evidence.inverse_dynamics.effect_variables import SMOOTHED
from ...evidence.second_method import NO_WORSE, Errors, JudgedGroup
from ...policy import ERRS_LESS

#: The model fitted to free runs of the estimation recordings.
Simulated = Callable[[Model], ParameterFit]

_LEVELS = 8
#: Standard error below which one is none.
_LEAST_ERROR = 1e-100
#: Factor by which the velocity of a smoothed sign may differ from SMOOTHED of the top speed: far below, the
#: error is as rough as without, and what is smooth far above is no dry friction.
_OTHERWISE = 5.0
#: Factor up to which the sizes that torques and free runs want are those of one effect.
_SAME = 2.0


def sized_freely(judged: JudgedGroup, simulated: Simulated, errors: Errors, fastest: float) -> JudgedGroup:
    """The group with the sizes that its free runs want, where those err on other recordings by ERRS_LESS as
    much and by no more on those that were fitted; else as it is. ``errors``: of free runs as long as those of
    the fit, like those in ``judged``. Standard errors hold what the two ways of fitting differ by.
    ``fastest``: top speed, rad/s."""
    group = judged.group
    try:
        found = _fitted(group.model, simulated, fastest)
        reached = errors(found.model)
    except (*FAILURES, ModelError):
        return judged
    before = [max(e, PERFECT) for e in judged.errors]
    if found.fled or not reached[0] < NO_WORSE * before[0] or not reached[1] < ERRS_LESS * before[1]:
        return judged
    if not _same_names(group.model, found.model):
        return judged
    one, other = group.model.parameter_values(), found.model.parameter_values()
    std = {}
    for name, error in group.std.items():
        own = found.std.get(name, math.nan)
        # Half the squared difference is the variance of either, if they have the same.
        apart = (one[name] - other[name]) / math.sqrt(2.0) if name in one and name in other else 0.0
        std[name] = math.hypot(own if math.isfinite(own) else error, apart)
    return JudgedGroup(replace(group, model=found.model, std=std, at_bound=()), judged.gain, reached)


def freely_sized(fit: Fit, simulated: Simulated, records: Sequence[Record], fastest: float) -> Fit | None:
    """A fit's model with the parameters that its free runs want, those of the structure beside a measured
    torque among them; None where they want none, or another size of what the model names. ``fastest``: top
    speed, rad/s."""
    try:
        found = _fitted(fit.model, simulated, fastest)
        if found.fled or not _same_names(fit.model, found.model):
            return None
        before = standard_errors(fit)
        std = {n: e if math.isfinite(e) else before.get(n, math.inf) for n, e in found.std.items()}
        sized = as_fitted(found.model, std, fit, records)
    except (*FAILURES, ModelError):
        return None
    return sized if math.isfinite(sized.log_likelihood) else None


def as_fitted(model: Model, std: Mapping[str, float], like: Fit, records: Sequence[Record]) -> Fit:
    """A model as it is, with noise levels for its observer, and the standard errors of its parameters
    (infinite: not determined; zero: not fitted)."""
    tuned = fit_whole(model, like.noise, records, free=(), iterations=_LEVELS)
    if not np.isfinite(tuned.log_likelihood):
        # The levels of a model far from this one may leave it without an observer.
        starts = noise_starts(model, records)
        begun = [fit_whole(model, n, records, free=(), iterations=_LEVELS) for n in starts]
        tuned = max(begun, key=lambda fit: fit.log_likelihood)
    names = tuple(n for n in model.free_parameters() if std.get(n, 0.0) > 0.0)
    information = np.diag(1.0 / np.maximum([std[n] for n in names], _LEAST_ERROR) ** 2)
    return replace(tuned, free=names, information=information, gradient=np.zeros(len(names)))


def _same_names(model: Model, other: Model) -> bool:
    """Whether two models have their effects with the same sizes, but for a factor of _SAME."""
    one, there = model.parameter_values(), other.parameter_values()
    return all(_alike(one[name], there.get(name, 0.0)) for name in _main_sizes(model))


def _main_sizes(model: Model) -> list[str]:
    """The first parameter of each effect that is none at zero, by its name in the model."""
    found = []
    for e in model.effects:
        sizes = [p.name for p in e.entry.parameters if p.default is None and p.neutral == 0.0]
        found += [f"{e.location}.{e.effect}.{name}" for name in sizes[:1]]
    return found


def _alike(one: float, other: float) -> bool:
    """Whether two sizes of an effect are one: what free runs shrink or swell by far more than that, they use
    in place of something else that is missing."""
    return 1.0 / _SAME <= abs(other) / max(abs(one), 1e-300) <= _SAME


def turning_limits(model: Model, fastest: float) -> dict[str, tuple[float, float]]:
    """Lowest and highest velocity within which a model's smoothed frictions may turn, by parameter name."""
    velocity = SMOOTHED * fastest
    return {
        f"{e.location}.{e.effect}.{name}": (velocity / _OTHERWISE, velocity * _OTHERWISE)
        for e in model.effects
        if (name := _turning(e)) is not None and e.values[name] > 0.0
    }


def _fitted(model: Model, simulated: Simulated, fastest: float) -> ParameterFit:
    """The fit of the model as it is or, where that errs less by ERRS_LESS (costs are squares), the sizes of
    the one whose frictions do not stick."""
    as_it_is = simulated(model)
    smooth = replace(model, effects=tuple(_smoothed(e, SMOOTHED * fastest) for e in model.effects))
    if smooth.effects == model.effects:
        return as_it_is
    found = simulated(smooth)
    if found.fled or not found.cost[1] < ERRS_LESS**2 * as_it_is.cost[1]:
        return as_it_is
    sizes = {n: v for n, v in found.model.parameter_values().items() if n in model.free_parameters()}
    return replace(found, model=model.with_values(sizes))


def _smoothed(effect: Effect, velocity: float) -> Effect:
    """The effect with a smoothed sign of the velocity, if it is friction that sticks."""
    name = _turning(effect)
    if name is None or effect.values[name] > 0.0:
        return effect
    return replace(effect, parameters={**effect.parameters, name: velocity})


def _turning(effect: Effect) -> str | None:
    """The parameter that says within which velocity the sign is smoothed, the last one of friction with a
    memory of its direction (see `EffectEntry`); None for other effects."""
    return effect.entry.parameters[-1].name if effect.entry.memory == "direction" else None
