"""What is left in the innovations: colour, and power that changes with time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.correlation import correlation
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import after_settling, channels, innovations, seen
from haptic_teleop_sysid.estimation.records import Record

#: Lags of the portmanteau test; of white innovations it is 25 on average, and 53 once in a thousand.
LAGS = 25
#: Samples over which the power of the innovations is averaged to see whether it changes with time.
STRETCH = 125
#: Power of innovations, in squares of the encoder's step, up to which one stretch is as steady as another:
#: where an axis hardly moves, errors of rounding (1/12) follow each other and their power changes by itself.
ROUNDING = 1.2 / 12.0
#: Samples over which innovations are added up to see whether they are normally distributed: a torque that
#: comes and goes for tenths of a second drowns in the rounding of single samples.
SUMMED = (32, 64, 128)
#: Excess kurtosis of such sums, in its standard deviations for normal ones, and at least, that every
#: recording must exceed: of pairs with white innovations one in some 4000 does (simulated, 5000 samples; the
#: tail of a kurtosis is long), and of 40 clean pairs of the blind benchmark none has more than 0.2.
HEAVY, AT_LEAST_HEAVY = 3.0, 0.5


def colour(fit: Fit, records: Sequence[Record]) -> float:
    """Largest portmanteau statistic (`ljung_box`) of the motor's innovations over the recordings."""
    return max((ljung_box(*_of_motor(fit, record)) for record in records), default=0.0)


def in_steps(fit: Fit, records: Sequence[Record]) -> float:
    """Largest rms of the motor's innovations over the recordings, in steps of its encoder."""
    found = []
    for record in records:
        e, read = _of_motor(fit, record)
        rms = float(np.sqrt(np.mean(e[read] ** 2))) if np.any(read) else 0.0
        found.append(rms / max(float(record.resolution[0]), 1e-12))
    return max(found, default=0.0)


def _of_motor(fit: Fit, record: Record) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The motor's settled innovations (n,), and which of them are of a reading (n,)."""
    packed = pack(fit.model)
    e = after_settling(record, innovations(packed, fit.noise, record).innovation)[:, 0]
    return e, after_settling(record, seen(packed, record))[:, 0]


def ljung_box(e: NDArray[np.float64], read: NDArray[np.bool_], lags: int = LAGS) -> float:
    """Portmanteau statistic of innovations (n,) of which those of ``read`` (n,) count (Ljung and Box 1978):

    Q = m (m + 2) sum over k of r_k^2 / (m - k),   k = 1 ... lags,

    ``lags`` on average for white ones; m readings, r_k autocorrelation at lag k. Where readings are missing
    m - k stands for the pairs that were read, and r_k is their mean product in units of the mean square.
    0 where there are too few to tell.
    """
    known = read & np.isfinite(e)
    m = int(np.count_nonzero(known))
    if m <= 2 * lags:
        return 0.0
    e = np.where(known, e - np.mean(e[known]), 0.0)
    power = float(e @ e) / m
    if power <= 0.0:
        return 0.0
    counted = known.astype(np.float64)
    pairs, products = correlation(counted, counted, lags)[1:], correlation(e, e, lags)[1:]
    return (m + 2) / m * float(np.sum((products / power) ** 2 / np.maximum(pairs, 1.0)))


def heaviness(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> dict[tuple[int, int], float]:
    """By encoder (0 motor, 1 arm) and number of samples added up (SUMMED): how far more often than normal
    ones sums of innovations are large, in units of what chance leaves, the least over the recordings of all
    (fit, recordings). As if each sample had been rounded once more, because where an axis rests there are no
    errors of rounding."""
    least: dict[tuple[int, int], float] = {}
    for fit, records in fits:
        packed = pack(fit.model)
        for record in records:
            e = after_settling(record, innovations(packed, fit.noise, record).innovation)
            read = after_settling(record, seen(packed, record)) & np.isfinite(e)
            for c in channels(packed, record):
                for size in SUMMED:
                    ratio = _heaviness(e[read[:, c], c], size, float(record.resolution[c]))
                    least[c, size] = min(least.get((c, size), np.inf), ratio)
    return least


def _heaviness(e: NDArray[np.float64], size: int, step: float) -> float:
    """Excess kurtosis of sums over ``size`` of the innovations, in units of what chance leaves."""
    count = len(e) // size
    if count < 2:
        return 0.0
    sums = e[: count * size].reshape(count, size).sum(axis=1)
    sums -= sums.mean()
    power = float(np.mean(sums**2))
    excess = float(np.mean(sums**4)) - 3.0 * power**2
    by_chance = max(AT_LEAST_HEAVY, HEAVY * float(np.sqrt(24.0 / count)))
    return excess / max(by_chance * (power + size * step**2 / 12.0) ** 2, 1e-300)


def unsteadiness(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> float:
    """How far the power of the innovations changes with time, on every recording of all (fit, recordings):
    the spread of its means over STRETCH samples, relative to what it is when samples are independent (then
    1), whatever their distribution.  Of two encoders the one that is less steady counts, and 0 where
    there is none."""
    least = np.full(2, np.inf)
    for fit, records in fits:
        packed = pack(fit.model)
        for record in records:
            used = channels(packed, record)
            least[[c for c in (0, 1) if c not in used]] = 0.0
            read = after_settling(record, seen(packed, record))
            power = after_settling(record, innovations(packed, fit.noise, record).innovation) ** 2
            for c in used:
                known = power[read[:, c], c]
                if not len(known):
                    least[c] = 0.0
                    continue
                parts = np.array([x.mean() for x in np.array_split(known, max(1, len(known) // STRETCH))])
                parts = np.maximum(parts, ROUNDING * record.resolution[c] ** 2)
                alone = float(known.std()) / np.sqrt(STRETCH)
                least[c] = min(least[c], float(parts.std()) / alone if alone > 0.0 else 0.0)
    return float(np.max(least, initial=0.0, where=np.isfinite(least)))
