"""How steady is the size of a torque from one stretch of the recordings to the next?

Friction, a spring or a ripple are constants of a joint: along any stretch of its motion their torque is the
same equation with the same size. A name that stands for something else fits it on average only. So the
torque of each name is given a size of its own in each stretch, beside the structure and the other names,
which keep theirs, and what these sizes differ by beyond their errors is their standard deviation between
stretches (a random-effects model; the estimator is that of Paule and Mandel, J. Res. NBS 87, 1982).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.simulation.covariance import deviations, sandwich, score_covariance

from ..hypotheses.follows import follows_from_input, follows_from_motion
from ..policy import SIGNIFICANT
from .inverse_dynamics.groups import independent
from .inverse_dynamics.products import Products
from .inverse_dynamics.regression import Equations, equations, own_columns
from .inverse_dynamics.terms import Hypothesis

FloatArray = NDArray[np.float64]

#: Stretches at most, and independent samples that each has at least: with fewer its error is not known.
MOST_STRETCHES, LEAST_SAMPLES = 8, 5.0
#: Share of the mean square that an effect has in all stretches which one must have to say something.
LEAST_SEEN = 0.01
#: Probability by chance below which sizes differ between stretches.
BY_CHANCE = 0.05


@dataclass(frozen=True)
class Steadiness:
    """Of one effect: its ``sizes`` in each stretch, relative to that of the model, and their standard errors
    ``std``, (stretches,) each; ``mean`` of the sizes with its standard error ``error``, and ``spread``, their
    standard deviation between stretches beyond these errors, 0 where it may be chance."""

    sizes: FloatArray
    std: FloatArray
    mean: float
    error: float
    spread: float

    @property
    def off(self) -> float:
        """What the model's size is off by, relative to it, as a standard deviation: the spread between
        stretches, and by what the mean differs from the model's where that is no chance."""
        apart = self.mean - 1.0
        return math.hypot(self.spread, apart if abs(apart) > SIGNIFICANT * self.error else 0.0)


def steadiness(
    model: Model, named: Sequence[Effect], records: Sequence[Record], cutoff: float
) -> dict[tuple[str, str], Steadiness]:
    """By name and location of each of the effects ``named`` of a model that are torques along the motion, or
    what an actuator makes of the input. ``cutoff``: Hz, of the band of the motion.

    Empty where recordings are too short to say, where the arithmetic of the regression fails, and of a joint
    that is flexible: behind its spring a torque shows in a deflection of which the encoders' steps and zeros
    are a large part."""
    asked = [e for e in named if follows_from_motion(e.entry) or follows_from_input(e.entry)]
    if not asked or not model.rigid:
        return {}
    names = {(e.effect, e.location) for e in asked}
    others = tuple(e for e in model.effects if (e.effect, e.location) not in names)
    bare = replace(model, effects=others, fixed=tuple(n for n in model.fixed if "." not in n))
    try:
        return _of(equations(bare, records, cutoff), asked)
    except FAILURES:
        return {}


def _of(side: Equations, asked: Sequence[Effect]) -> dict[tuple[str, str], Steadiness]:
    group = tuple(Hypothesis.of(e, side.model.place(e.location)) for e in asked)
    products = Products(side)
    rows, target = products.columns(group), products.target.ravel()
    samples = len(target)
    number = independent(target - rows @ np.linalg.lstsq(rows, target, rcond=None)[0])
    stretches = int(min(MOST_STRETCHES, number / LEAST_SAMPLES))
    if stretches < 2:
        return {}
    where = np.arange(samples) * stretches // samples  # (n,): in which stretch a row lies
    found = {}
    for h, own in own_columns(side.names, group):
        apart = rows[:, own] * (where[:, None] == np.arange(stretches))
        apart = apart[:, _seen(apart)]
        if apart.shape[1] < 2:
            continue
        wider = np.hstack([np.delete(rows, own, axis=1), apart])
        values = np.linalg.lstsq(wider, target, rcond=None)[0]
        scores = wider * (target - wider @ values)[:, None]
        meat = score_covariance(scores, max(1, round(samples / number)))
        errors = deviations(sandwich(wider.T @ wider, meat))
        count = apart.shape[1]
        found[h.entry.name, h.location] = _steadiness(values[-count:], np.maximum(errors[-count:], 1e-9))
    return found


def _seen(apart: FloatArray) -> NDArray[np.bool_]:
    """Which of the columns (n, stretches) have LEAST_SEEN of the mean square of all: a stop is reached in few
    stretches."""
    power = np.einsum("ij,ij->j", apart, apart)
    return power > LEAST_SEEN * np.mean(power)


def _steadiness(sizes: FloatArray, std: FloatArray) -> Steadiness:
    """Mean and spread of sizes with standard errors ``std`` (Paule and Mandel)."""

    def mean(variance: float) -> float:
        weights = 1.0 / (std**2 + variance)
        return float(weights @ sizes / np.sum(weights))

    def apart(variance: float) -> float:
        return float(np.sum((sizes - mean(variance)) ** 2 / (std**2 + variance)))

    freedom, variance = len(sizes) - 1, 0.0
    if apart(0.0) > scipy.stats.chi2.isf(BY_CHANCE, freedom):
        # There the sum is less than the degrees of freedom, whatever the errors are.
        most = float(np.sum((sizes - np.mean(sizes)) ** 2))
        variance = float(scipy.optimize.brentq(lambda v: apart(v) - freedom, 0.0, most))
    error = float(np.sum(1.0 / (std**2 + variance)) ** -0.5)
    return Steadiness(sizes, std, mean(variance), error, math.sqrt(variance))


def spread_by_stretch(steady: Mapping[tuple[str, str], Steadiness], model: Model) -> dict[str, float]:
    """By full parameter name, in its unit: what the sizes of a model's effects are off by (`Steadiness.off`),
    as a standard deviation."""
    found = {}
    for effect in model.effects:
        one = steady.get((effect.effect, effect.location))
        if one is None:
            continue
        for p in effect.entry.parameters:
            if p.default is None and p.neutral == 0.0:
                found[f"{effect.location}.{effect.effect}.{p.name}"] = one.off * abs(effect.values[p.name])
    return found
