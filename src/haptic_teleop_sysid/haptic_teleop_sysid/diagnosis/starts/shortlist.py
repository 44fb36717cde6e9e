"""Which effects are worth a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits

from ..hypotheses.candidates import Scanned, candidates
from ..inputs.scales import Scales
from .scan import both, scan
from .screen import Screened, best_per_effect, screen
from .trials import quiet

#: Least promised gain (nats) that a re-fit is spent on, the most re-fits of a round under each noise model,
#: and how many of the best under the other one are among them.
_WORTH_A_FIT = 6.0
_MOST_FITS = 8
_BEST_OF_THE_OTHER = 3
#: Starts of one effect that are screened under both noise models.
_STARTS_ONCE_MORE = 3


def shortlist(
    fit: Fit, records: Sequence[Record], scales: Scales, limits: Limits, first: bool, late: Scanned
) -> tuple[list[Screened], list[Screened]]:
    """The effects worth a fit, by what a linearisation promises: under the noise model as it was fitted, and
    under a quiet one.

    Where much is unexplained the fitted noise model takes it for a disturbance, under which no effect
    promises much: a delay of 16 ms that a fit explains with hundreds of nats promised less than seven.
    ``first``: the first look, for which both are scanned; ``late``: starts of what makes a channel late.
    """
    still = fit_parameters(fit.model, quiet(fit.noise), records, iterations=12, limits=limits)
    if not np.isfinite(still.log_likelihood):
        still = fit
    scanned = scan(fit, records, scales)
    if first:
        scanned = both(scanned, scan(still, records, scales))
    effects = list(candidates(fit.model, records, scales, {**scanned, **late}))
    ranked = []
    for one in (fit, still):
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
