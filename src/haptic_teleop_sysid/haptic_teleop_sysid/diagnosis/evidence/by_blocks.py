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

from haptic_teleop_sim.kernel import Packed, pack
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import (
    FAILURES,
    covariance,
    innovations,
    seen,
    settled,
)
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
            nats = _by_sample(packed, record, innovation)
        except FAILURES:
            return None
        rows.append([float(np.sum(block)) for block in np.array_split(nats, BLOCKS)])
    found = np.array(rows)
    return found if np.all(np.isfinite(found)) else None


def _by_sample(packed: Packed, record: Record, innovation: FloatArray) -> FloatArray:
    """The log-likelihood (n,) of each settled sample, as `likelihood.log_likelihood` counts it: variances by
    the readings that were taken, so that a model whose encoder is late is judged by as many as any other;
    the arm's reading given the motor's, and by itself where that is missing."""
    spread = covariance(packed, record, innovation)
    used = len(spread)
    taken = settled(record, np.isfinite(record.measured))[:, :used]
    there = settled(record, seen(packed, record))[:, :used]
    e = settled(record, innovation)[:, :used]
    motor = float(spread[0, 0])
    nats = -0.5 * (taken[:, 0] * np.log(motor) + there[:, 0] * e[:, 0] ** 2 / motor)
    if used == 1:
        return nats
    arm, slope = float(spread[1, 1]), float(spread[0, 1]) / motor
    beside = arm - slope * float(spread[0, 1])
    for variance, left, which in ((beside, e[:, 1] - slope * e[:, 0], True), (arm, e[:, 1], False)):
        counted, shown = (one[:, 1] & (one[:, 0] == which) for one in (taken, there))
        nats -= 0.5 * (counted * np.log(variance) + shown * left**2 / variance)
    return nats


def chance(one: FloatArray | None, other: FloatArray | None) -> float | None:
    """Return the standard error, nats, of the difference of two models' log-likelihoods over all recordings,
    from `by_blocks` of both; None where one is not known."""
    if one is None or other is None:
        return None
    return float(np.sqrt(np.sum(BLOCKS * np.var(one - other, axis=1, ddof=1))))


def seen_steadily(gain: float, blocks: FloatArray | None, without: FloatArray | None) -> float:
    """Return the chance (0 to 1) that recordings as long as these speak for a model again, whose gain over
    that without its effect is ``gain`` nats; 1 where the blocks are not known, as of what the currents or
    free runs show. What shows in one block alone has 0.84."""
    scatter = chance(blocks, without)
    if scatter is None:
        return 1.0
    return 0.5 * math.erfc(-gain / max(scatter, 1e-9) / math.sqrt(2.0))
