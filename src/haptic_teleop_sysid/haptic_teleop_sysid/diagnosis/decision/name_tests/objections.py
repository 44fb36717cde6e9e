"""What speaks against a finding that its rivals do not tell: another size on other recordings, a size that
follows something else, nothing but one-step predictions for it, and what the observer is left with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.certainty import standard_errors
from ...evidence.events import all_the_time
from ...evidence.held_out import held_out_fit
from ...evidence.whiteness import colour, unsteadiness
from ...policy import COLOURED, UNSTEADY, WHITE
from ..coloured import by_steps, more_coloured
from ..corroborated import Corroborated
from ..reasons import momentary
from ..search.decide import Choice
from .changing_size import changing_with, fitted_there, in_words

#: Share of the baseline's value from which an effect has not explained that.
UNCHANGED = 0.3
#: Share of the baseline's unsteadiness from which an effect has not explained that.
AS_UNSTEADY = 0.7
#: A size is another one on other recordings when it differs by this share and by this many standard errors.
OTHER_SIZE = 0.4
OTHER_SIZE_ERRORS = 5.0
#: A finding that takes away this share of the simulation's error on validation recordings stays, whatever is
#: left beside it.
CLEARLY_BETTER = 0.4

#: What speaks against a finding, in words, and when it shows (see `Doubt`); None for nothing.
Objection = tuple[str, str | None] | None


@dataclass(frozen=True)
class Objections:
    """To a finding of these recordings, beside ``baseline``, the structure alone, and ``baseline_there``, the
    same with the validation recordings' noise levels; ``before``: colour of both. ``percent`` and
    ``corroborated``: see `doubted`."""

    baseline: Fit
    baseline_there: Fit
    before: tuple[float, float]
    estimation: Sequence[Record]
    validation: Sequence[Record]
    percent: Callable[[Model], Sequence[float]]
    corroborated: Corroborated

    def to(self, choice: Choice, so_far: Fit) -> Objection:
        """The first one to a finding; ``so_far``: the fit without it."""
        found = momentary(choice, so_far, self.estimation, self.validation)
        if found is not None or choice.chosen.by_current > 0.0:
            return found  # or seen in the currents, on both kinds of recordings
        fit, effect = choice.chosen.fit, choice.chosen.effect
        there = held_out_fit(fit, self.validation, [fit.noise])
        return self._of_size(fit, there, effect) or self._of_innovations(fit, there, effect, so_far)

    def _of_size(self, fit: Fit, there: Fit, effect: Effect) -> Objection:
        """It has another size on the other recordings, or its size changes with something."""
        head = f"{effect.location}.{effect.effect}."
        again = fitted_there(fit, there, effect, self.validation)
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
        changing = changing_with(fit, again, effect, self.estimation, self.validation)
        return None if changing is None else (in_words(effect, *changing), changing[0])

    def _of_innovations(self, fit: Fit, there: Fit, effect: Effect, so_far: Fit) -> Objection:
        """They stay coloured or unsteady with it, and nothing but them speaks for it."""
        after = colour(fit, self.estimation), colour(there, self.validation)
        with_it = [(fit, self.estimation), (there, self.validation)]
        white = min(after) <= WHITE or by_steps(after, with_it)
        if not white and not self.corroborated(fit, so_far, effect):
            why = (
                f"only one-step predictions speak for {effect.effect}, and their errors stay correlated with "
                "it; neither free-run simulations nor the torques bear it out"
            )
            return why, None
        error_before, error_after = (
            100.0 - np.array(self.percent(m)) for m in (self.baseline.model, fit.model)
        )
        if np.any(error_after < (1.0 - CLEARLY_BETTER) * error_before):
            return None
        pairs = zip(after, self.before, strict=True)
        unchanged = all(now > max(COLOURED, UNCHANGED * then) for now, then in pairs)
        if unchanged and more_coloured(after, with_it):
            return f"with {effect.effect} the observer keeps correcting much as it did without", None
        without = [(self.baseline, self.estimation), (self.baseline_there, self.validation)]
        unsteady = unsteadiness(with_it)
        if unsteady <= UNSTEADY or unsteady <= AS_UNSTEADY * unsteadiness(without):
            return None
        beside = held_out_fit(so_far, self.validation, [there.noise])
        if all_the_time(so_far, fit, self.estimation) and all_the_time(beside, there, self.validation):
            return None
        return f"something acts at some times and not at others, with {effect.effect} as without", "time"
