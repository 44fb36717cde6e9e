"""Maximise the likelihood over the parameters without derivatives (Powell, The Computer Journal 7, 1964).

Derivatives of a predictor at held noise levels leave out that its observer changes with the parameters: at
the top they promise a step that there is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model

from .fit import Fit
from .likelihood import likelihood_of
from .records import Record
from .step_limits import Limits, at_bound, bounds, most_substeps, substeps

FloatArray = NDArray[np.float64]

#: Evaluations by parameter.
MOST_TRIALS = 60


def searched_without_derivatives(fit: Fit, records: Sequence[Record], limits: Limits | None) -> Fit:
    """The fit where its steps ended at the top, else the best that a search without derivatives finds from
    there within the bounds, at the same noise levels."""
    if fit.converged or not np.isfinite(fit.log_likelihood):
        return fit
    low, high = bounds(fit.model, fit.free, limits)
    values = fit.model.parameter_values()
    begin = np.array([values[name] for name in fit.free])
    spread = 1.0 / np.sqrt(np.maximum(np.diag(fit.information), 1e-300))
    spread = np.where(begin != 0.0, np.minimum(spread, np.abs(begin)), spread)
    allowed = most_substeps(fit.model, records)

    def values_at(shift: FloatArray) -> FloatArray:
        return np.clip(begin + shift * spread, low, high)

    def at(shift: FloatArray) -> Model:
        return fit.model.with_values(dict(zip(fit.free, values_at(shift).tolist(), strict=True)))

    def cost(shift: FloatArray) -> float:
        model = at(shift)
        if substeps(model, records) > allowed:
            return np.inf
        return -likelihood_of(pack(model), fit.noise, records)

    found = scipy.optimize.minimize(
        cost,
        np.zeros(len(begin)),
        method="Powell",
        options={"maxfev": MOST_TRIALS * len(begin), "xtol": 0.1, "ftol": 1e-9},
    )
    if not -found.fun >= fit.log_likelihood:
        return fit
    ended = bool(found.success)
    return replace(
        fit,
        model=at(found.x),
        log_likelihood=-float(found.fun),
        converged=ended,
        message="converged without derivatives" if ended else fit.message,
        at_bound=at_bound(fit.free, values_at(found.x), low, high),
    )
