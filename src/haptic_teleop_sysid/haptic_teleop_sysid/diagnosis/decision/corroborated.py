"""What only likelihoods speak for, where the noise model behind them does not hold.

Likelihoods of one-step predictions are right where the innovations are white. Where they stay coloured, an
effect also gains by predicting what is missing: a time stamp that is a sample off, a ripple, an encoder that
errs. Two other methods need no noise model: free runs, which nothing corrects, and the torques that the
motion asks for. A finding that neither of them bears out is given up.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES

from ..evidence.horizons import PERFECT
from ..evidence.inverse_dynamics.terms import Hypothesis
from ..evidence.second_method import Errors, SecondMethod
from ..hypotheses.follows import follows_from_motion
from ..policy import ERRS_LESS, LEAST_GAIN


@dataclass(frozen=True)
class Corroboration:
    """Asks free runs and torques of findings. ``errors``: of free runs (see `Errors`); ``second_method``: of
    the inverse dynamics, None where their arithmetic failed."""

    errors: Errors
    second_method: SecondMethod | None

    def __call__(self, fit: Fit, so_far: Fit, effect: Effect) -> bool:
        """Whether an effect of a fit is borne out, beside ``so_far``, the fit without it: the torques gain by
        it, or free runs err less."""
        return self.by_torques(fit.model, effect) or self.by_free_runs(fit, so_far, effect) < ERRS_LESS

    def by_free_runs(self, fit: Fit, so_far: Fit, effect: Effect) -> float:
        """Error of the free runs with an effect (geometric mean of both kinds of recordings), over that
        without it, or with as few names of the inverse dynamics where that is less."""
        without = [_error(self.errors(so_far.model)), *self._instead(fit.model, effect)]
        return _error(self.errors(fit.model)) / min(without)

    def elsewhere(self, fit: Fit, so_far: Fit) -> float:
        """Error of the free runs of a fit on the validation recordings, over that of another fit."""
        ours, theirs = (max(self.errors(one.model)[1], PERFECT) for one in (fit, so_far))
        return ours / theirs

    def _instead(self, model: Model, effect: Effect) -> list[float]:
        """Error of the free runs with what the inverse dynamics name, where the effect is not among them, and
        no more effects than the model has."""
        chosen = None if self.second_method is None else self.second_method.chosen
        if chosen is None or len(chosen.group.model.effects) > len(model.effects):
            return []
        names = [(e.effect, e.location) for e in chosen.group.effects]
        return [] if (effect.effect, effect.location) in names else [_error(chosen.errors)]

    def by_torques(self, model: Model, effect: Effect) -> bool:
        """Whether the torques gain LEAST_GAIN by an effect of a model on stretches that were not fitted,
        beside the other effects with sizes of their own."""
        if self.second_method is None or not adds_torque(effect):
            return False
        folds = self.second_method.searched.folds
        known = {(e.effect, e.location) for e in (*folds.model.effects, effect)}
        others = [e for e in model.effects if (e.effect, e.location) not in known and adds_torque(e)]
        own = Hypothesis.of(effect, model.place(effect.location))
        rest = tuple(Hypothesis.resized(e, model.place(e.location)) for e in others)
        try:
            return folds.likelier((*rest, own)) - folds.likelier(rest) > LEAST_GAIN
        except FAILURES:
            return False


Corroborated = Callable[[Fit, Fit, Effect], bool]


def _error(errors: tuple[float, float]) -> float:
    """Geometric mean of the errors of both kinds of recordings."""
    return math.sqrt(math.prod(max(e, PERFECT) for e in errors))


def adds_torque(effect: Effect) -> bool:
    """Whether the effect adds to the torques, along the motion or between command and torque."""
    return follows_from_motion(effect.entry) or effect.entry.kind == "input"
