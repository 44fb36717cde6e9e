"""How steadily recordings speak for one model rather than another.

The log-likelihood of a recording is a sum over its samples. Of white innovations with the noise that the
models have, the difference of two such sums scatters by a few nats; on a machine, where neither model is
quite right and what is left goes on from sample to sample, by far more. So the samples are taken together in
blocks, and the difference's standard error is that of a sum of so many blocks (Vuong, Econometrica 57 (1989),
with the variance by batch means). It holds where a block is longer than what is left remembers, and is too
small for recordings of a few seconds beside slow disturbances.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, by_sample, innovations
from haptic_teleop_sysid.estimation.records import Record

FloatArray = NDArray[np.float64]

#: Blocks of each recording. Fewer: the error is not known well; more: shorter than what is left remembers.
BLOCKS = 20


def by_blocks(told: Iterable[tuple[Fit, Sequence[Record]]]) -> FloatArray | None:
    """Return (recordings, BLOCKS): the log-likelihood of each block of recordings under the fit they are
    ``told`` with, nats, but for half a nat per reading; None where it cannot be computed. Blocks are those of
    the recording, so that they are the same for all models."""
    rows = []
    for fit, record in ((fit, record) for fit, records in told for record in records):
        packed = pack(fit.model)
        try:
            innovation = innovations(packed, fit.noise, record).innovation
            nats = by_sample(packed, record, innovation)
        except FAILURES:
            return None
        rows.append([float(np.sum(block)) for block in np.array_split(nats, BLOCKS)])
    found = np.array(rows)
    return found if np.all(np.isfinite(found)) else None


def chance(gains: FloatArray | None, others: FloatArray | float | None = 0.0) -> float | None:
    """Return the standard error, nats, of what recordings speak for one model more than for another, from
    what both gain in each block over the model without their effect, which has 0; None where one is not
    known."""
    if gains is None or others is None:
        return None
    return float(np.sqrt(np.sum(BLOCKS * np.var(gains - others, axis=1, ddof=1))))


def seen_steadily(gain: float, gains: FloatArray | None) -> float:
    """Return the chance (0 to 1) that recordings as long as these speak for a model again that gains ``gain``
    nats, ``gains`` in each block; 1 where these are not known, as of what the currents or free runs show.
    What shows in one block alone has 0.84."""
    scatter = chance(gains)
    if scatter is None:
        return 1.0
    return 0.5 * math.erfc(-gain / max(scatter, 1e-9) / math.sqrt(2.0))
