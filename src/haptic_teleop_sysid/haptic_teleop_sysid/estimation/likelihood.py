"""How well a model with a noise model predicts recordings: innovations and their likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed, Prediction, predict

from .noise import NoiseModel, observer_gain
from .records import Record

FloatArray = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

#: Seconds at the start of a recording in which the observer settles and the innovations do not count.
SETTLING = 0.2
#: Innovations (rad) whose squares are beyond all meaning, and soon beyond the range of numbers.
_RUNS_AWAY = 1e100
#: Readings below which an encoder counts as not recorded: fewer have no variance to speak of.
FEWEST_READINGS = 10
#: What linear algebra and arithmetic raise where numbers are beyond them.  It ends the model that was tried,
#: not the program.
FAILURES = (np.linalg.LinAlgError, ValueError, ArithmeticError)


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
        moment=record.moment,
        t0=record.start,
    )


def after_settling(record: Record, values: NDArray[Scalar]) -> NDArray[Scalar]:
    """The part of ``values`` (n, ...) after the observer has settled; at most a tenth is left out."""
    return values[settling(record) :]


def settling(record: Record) -> int:
    """Samples at the start that do not count."""
    return 0 if record.at_rest else min(round(SETTLING / record.dt), len(record) // 10)


def channels(packed: Packed, record: Record) -> list[int]:
    """Encoders that take part: the motor's, and the arm's where there is one."""
    if packed.rigid or record.readings[1] < FEWEST_READINGS:
        return [0]
    return [0, 1]


def seen(packed: Packed, record: Record) -> NDArray[np.bool_]:
    """Which innovations (n, 2) come of a reading: readings of a late encoder are moved ahead, see `predict`,
    and 0 stands for those that are missing."""
    whole = packed.encoder_shift(record.dt)[0]
    if not whole.any():
        return record.read
    there = record.read.copy()
    for channel in np.flatnonzero(whole):
        source = np.arange(len(there)) + whole[channel]
        inside = (source >= 0) & (source < len(there))
        there[:, channel] = inside & there[np.clip(source, 0, len(there) - 1), channel]
    return there


def innovation_covariance(packed: Packed, record: Record, innovation: FloatArray) -> FloatArray:
    """Second moment of the settled innovations, (1, 1) or (2, 2), rad^2.

    Of the readings alone: the motor's own moment, and the arm's by its regression on the motor's where both
    were read (maximum likelihood where the arm's are missing, Anderson 1957)."""
    used = len(channels(packed, record))
    # A slice, as the channels are the first ones: picking columns would copy.
    e, there = (
        after_settling(record, innovation)[:, :used],
        after_settling(record, seen(packed, record))[:, :used],
    )
    if there.all():
        return e.T @ e / len(e)
    motor = float(e[:, 0] @ e[:, 0]) / max(np.count_nonzero(there[:, 0]), 1)
    if used == 1:
        return np.array([[motor]])
    both = there.all(axis=1)
    count, pairs = np.count_nonzero(both), e[both]
    if count < FEWEST_READINGS:  # read in turn
        return np.diag([motor, float(e[:, 1] @ e[:, 1]) / max(np.count_nonzero(there[:, 1]), 1)])
    own, mixed, arm = (float(pairs[:, i] @ pairs[:, j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    slope = mixed / own if own > 0.0 else 0.0
    left = (arm - slope * mixed) / count
    return np.array([[motor, slope * motor], [slope * motor, left + slope**2 * motor]])


def log_likelihood(packed: Packed, records: Sequence[Record], innovation: Sequence[FloatArray]) -> float:
    """Gaussian log-likelihood of the innovations with their covariance S concentrated out, per recording:
    -n/2 log det S, S = 1/n sum e e'; constants are left out.  A reading that is missing has no score: n
    counts those of each encoder, the arm's where the motor's is missing by its own variance.  -inf when a
    prediction overflowed."""
    total = 0.0
    for record, e in zip(records, innovation, strict=True):
        if not np.max(np.abs(e), initial=0.0) < _RUNS_AWAY:
            return -np.inf
        spread = innovation_covariance(packed, record, e)
        sign, value = np.linalg.slogdet(spread)
        if sign <= 0:
            return -np.inf
        # Of the recording, so that a model whose encoder is late is judged by as many readings as any other.
        taken = after_settling(record, record.read)[:, : len(spread)]
        if taken.all():
            total -= 0.5 * len(taken) * float(value)
            continue
        total -= 0.5 * np.count_nonzero(taken[:, 0]) * float(np.log(spread[0, 0]))
        if len(spread) == 2:
            both = np.count_nonzero(taken.all(axis=1))
            total -= 0.5 * both * float(value - np.log(spread[0, 0]))
            alone = after_settling(record, e)[taken[:, 1] & ~taken[:, 0], 1]
            arm = float(spread[1, 1])
            total -= 0.5 * (len(alone) * (np.log(arm) - 1.0) + float(alone @ alone) / arm)
    return float(total)


def by_sample(packed: Packed, record: Record, innovation: FloatArray) -> FloatArray:
    """The log-likelihood (n,) of each settled sample, as `log_likelihood` counts it: variances by
    the readings that were taken, so that a model whose encoder is late is judged by as many as any other;
    the arm's reading given the motor's, and by itself where that is missing. In sum it is the same but for
    half a nat per reading."""
    spread = innovation_covariance(packed, record, innovation)
    used = len(spread)
    taken = after_settling(record, record.read)[:, :used]
    there = after_settling(record, seen(packed, record))[:, :used]
    e = after_settling(record, innovation)[:, :used]
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


def likelihood_of(packed: Packed, noise: NoiseModel, records: Sequence[Record]) -> float:
    """Log-likelihood of recordings under a model and a noise model; -inf where it cannot be computed."""
    try:
        return log_likelihood(packed, records, [innovations(packed, noise, r).innovation for r in records])
    except FAILURES:
        return -np.inf
