"""Fits that simulate, where those that predict best do not.

One-step predictions of a machine with more missing than its model has are best with parameters that run
away when nothing corrects them: a re-estimate that simulates worse than what it began with helps nobody.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit

from ...evidence.second_method import Errors
from ...policy import ERRS_LESS
from .rounds import SearchResult

#: A fit with the parameters that its free runs want, None where they want none (see `freely_sized`).
Resized = Callable[[Fit], Fit | None]


def simulating_best(fit: Fit, starts: Sequence[Model], resized: Resized, errors: Errors) -> Fit:
    """The fit, or the one to free runs from one of ``starts`` which errs least on the estimation recordings,
    by ERRS_LESS at least, and no more on the others; ``errors``: of free runs."""
    before = least = errors(fit.model)
    best = fit
    for start in starts:
        other = resized(replace(fit, model=start))
        if other is None:
            continue
        found = errors(other.model)
        enough = min(ERRS_LESS * before[0], least[0])
        if all(np.isfinite(found)) and found[0] < enough and found[1] <= before[1]:
            best, least = other, found
    return best


def re_estimated(result: SearchResult, given: Model, resized: Resized, errors: Errors) -> SearchResult:
    """The result, with the structure alone fitted to free runs where the ``given`` model simulates the
    estimation recordings clearly better (ERRS_LESS) and that helps on both kinds; what was found stays as it
    is."""
    baseline = result.baseline
    if not errors(given)[0] < ERRS_LESS * errors(baseline.model)[0]:
        return result
    better = simulating_best(baseline, [given], resized, errors)
    alone = result.final is baseline
    return replace(result, baseline=better, final=better if alone else result.final)
