"""What is left in the innovations: colour, and power that changes with time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import channels, innovations, settled
from haptic_teleop_sysid.estimation.records import Record

#: Lags of the portmanteau test; of white innovations it is 25 on average, and 53 once in a thousand.
LAGS = 25
#: Samples over which the power of the innovations is averaged to see whether it changes with time.
STRETCH = 125
#: Power of innovations, in squares of the encoder's step, up to which one stretch is as steady as another:
#: where an axis hardly moves, errors of rounding (1/12) follow each other and their power changes by itself.
ROUNDING = 1.2 / 12.0


def colour(fit: Fit, records: Sequence[Record]) -> float:
    """Largest portmanteau statistic of the motor's innovations over the recordings: n times the sum of
    squared autocorrelations at the first LAGS lags, LAGS on average for white ones."""
    found = []
    for record in records:
        e = settled(record, innovations(pack(fit.model), fit.noise, record).innovation)[:, 0]
        e = e[np.isfinite(e)] - np.mean(e[np.isfinite(e)])
        power = float(e @ e)
        if power <= 0.0 or len(e) <= 2 * LAGS:
            continue
        found.append(len(e) * sum((float(e[k:] @ e[:-k]) / power) ** 2 for k in range(1, LAGS + 1)))
    return max(found, default=0.0)


def unsteadiness(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> float:
    """How far the power of the innovations changes with time, on every recording of all (fit, recordings):
    the spread of its means over STRETCH samples, relative to what it is when samples are independent (then
    1), whatever their distribution.  Of two encoders the one that is less steady counts, and 0 where
    there is none."""
    least = np.full(2, np.inf)
    for fit, records in fits:
        packed = pack(fit.model)
        for record in records:
            seen = channels(packed, record)
            least[[c for c in (0, 1) if c not in seen]] = 0.0
            power = settled(record, innovations(packed, fit.noise, record).innovation) ** 2
            parts = np.array([x.mean(axis=0) for x in np.array_split(power, max(1, len(power) // STRETCH))])
            parts = np.maximum(parts, ROUNDING * np.square(record.resolution))
            alone = power.std(axis=0) / np.sqrt(STRETCH)
            ratio = np.divide(parts.std(axis=0), alone, out=np.zeros(2), where=alone > 0.0)
            least = np.minimum(least, ratio)
    return float(np.max(least, initial=0.0, where=np.isfinite(least)))
