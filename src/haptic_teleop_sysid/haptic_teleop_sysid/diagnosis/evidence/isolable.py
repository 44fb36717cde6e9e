"""Can these recordings tell two fitted models apart at all?

Two models whose predictions of every next sample hardly differ are one thing to the recordings, whichever of
them chance favours: of Gaussian innovations with one covariance S and means e1, e2 the expected difference of
log-likelihoods is the divergence of Kullback and Leibler, 1/2 sum (e1 - e2)' S^-1 (e1 - e2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import (
    FAILURES,
    after_settling,
    innovation_covariance,
    innovations,
)
from haptic_teleop_sysid.estimation.records import Record


def nats_apart(one: Fit, other: Fit, records: Sequence[Record]) -> float:
    """Nats by which the recordings are expected to speak for ``one`` against ``other`` if it is true: their
    innovations compared under the noise model of ``one``; 0 or more, infinite for a model that runs away."""
    first, second = pack(one.model), pack(other.model)
    total = 0.0
    for record in records:
        try:
            errors, others = (innovations(m, one.noise, record).innovation for m in (first, second))
        except FAILURES:  # no observer for this model with the other one's noise
            return np.inf
        spread = innovation_covariance(first, record, errors)
        apart = after_settling(record, errors - others)[:, : len(spread)]
        if not np.all(np.isfinite(apart)) or not np.all(np.isfinite(spread)):
            return np.inf
        total += 0.5 * float(np.einsum("ni,ij,nj->", apart, np.linalg.pinv(spread, hermitian=True), apart))
    return total
