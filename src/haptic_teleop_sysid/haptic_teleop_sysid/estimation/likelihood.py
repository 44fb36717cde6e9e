"""How well a model with a noise model predicts recordings: innovations and their likelihood."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed, Prediction, predict

from .noise import NoiseModel, observer_gain
from .records import Record

FloatArray = NDArray[np.float64]

#: Seconds at the start of a recording in which the observer settles and the innovations do not count.
SETTLING = 0.2
#: Innovations (rad) whose squares are beyond all meaning, and soon beyond the range of numbers.
_RUNS_AWAY = 1e100


def innovations(
    packed: Packed,
    noise: NoiseModel,
    record: Record,
    free: tuple[str, ...] = (),
    gain: FloatArray | None = None,
    gain_slopes: tuple[FloatArray, FloatArray] | None = None,
) -> Prediction:
    """One-step predictions of a recording, with derivatives by ``free`` at a held observer gain (that of the
    model and the noise model, or ``gain``), or one that depends on them by ``gain_slopes`` (see `predict`);
    LinAlgError for an impossible noise model."""
    return predict(
        packed,
        record.input,
        record.measured,
        record.dt,
        free,
        gain=observer_gain(packed, noise, record.dt, channels(packed, record)) if gain is None else gain,
        decay=noise.decay(record.dt),
        gain_slopes=gain_slopes,
        initial_state=record.initial_state(),
        exogenous=record.exogenous,
        t0=record.start,
    )


def settled(record: Record, values: FloatArray) -> FloatArray:
    """The part of ``values`` (n, ...) after the observer has settled; at most a tenth is left out."""
    return values[settling(record) :]


def settling(record: Record) -> int:
    """Samples at the start that do not count."""
    return 0 if record.at_rest else min(round(SETTLING / record.dt), len(record) // 10)


def channels(packed: Packed, record: Record) -> list[int]:
    """Encoders that take part: the motor's, and the arm's where there is one."""
    if packed.rigid or not np.any(np.isfinite(record.measured[:, 1])):
        return [0]
    return [0, 1]


def covariance(packed: Packed, record: Record, innovation: FloatArray) -> FloatArray:
    """Second moment of the settled innovations, (1, 1) or (2, 2), rad^2."""
    # A slice, as the channels are the first ones: picking columns would copy.
    e = settled(record, innovation)[:, : len(channels(packed, record))]
    return e.T @ e / len(e)


def log_likelihood(packed: Packed, records: Sequence[Record], innovation: Sequence[FloatArray]) -> float:
    """Gaussian log-likelihood of the innovations with their covariance concentrated out, per recording:
    -n/2 log det (1/n sum e e'); constants are left out.  -inf when a prediction overflowed."""
    total = 0.0
    for record, e in zip(records, innovation, strict=True):
        if not np.max(np.abs(e), initial=0.0) < _RUNS_AWAY:
            return -np.inf
        sign, value = np.linalg.slogdet(covariance(packed, record, e))
        if sign <= 0:
            return -np.inf
        total -= 0.5 * len(settled(record, e)) * float(value)
    return total
