"""What a fit's recordings know of its parameters: covariances, standard errors, and what is known of some
whatever the others are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.simulation.covariance import deviations, scaled_inverse

FloatArray = NDArray[np.float64]


def parameter_covariance(fit: Fit, held: Sequence[str]) -> tuple[list[str], FloatArray, FloatArray]:
    """Names (p) of what is known beside ``held``, and the covariance (p, p) of these in units of 1 / scale
    (p,). What is left of an information that the noise levels took can be zero or less by rounding: of those
    nothing is known."""
    kept = [i for i, n in enumerate(fit.free) if n not in held and fit.information[i, i] > 0.0]
    scale, inverse, _ = scaled_inverse(fit.information[np.ix_(kept, kept)])
    return [fit.free[i] for i in kept], scale, inverse


def standard_errors(fit: Fit, held: Sequence[str] = ()) -> dict[str, float]:
    """Standard errors by parameter name, from the information matrix (parameters at a bound have none), those
    of ``held`` known; infinite where derivatives have overflowed or say nothing, so that nothing is
    significant."""
    errors = {name: float("inf") for name in fit.free if name not in held}
    if not np.all(np.isfinite(fit.information)):
        return errors
    names, scale, inverse = parameter_covariance(fit, held)
    found = deviations(inverse) / scale
    return errors | dict(zip(names, found.tolist(), strict=True))


def known_beside(fit: Fit, own: Sequence[str]) -> FloatArray:
    """Information (p, p) that the fit's recordings have about its free parameters but ``own``, of which
    nothing is taken to be known: what they say of the others whatever those are (Schur complement)."""
    mine = [i for i, n in enumerate(fit.free) if n in own]
    rest = [i for i, n in enumerate(fit.free) if n not in own]
    known = np.zeros((len(fit.free), len(fit.free)))
    if not np.all(np.isfinite(fit.information)):
        return known
    scale, inverse, _ = scaled_inverse(fit.information[np.ix_(mine, mine)])
    cross = fit.information[np.ix_(rest, mine)] / scale
    known[np.ix_(rest, rest)] = fit.information[np.ix_(rest, rest)] - cross @ inverse @ cross.T
    return known
