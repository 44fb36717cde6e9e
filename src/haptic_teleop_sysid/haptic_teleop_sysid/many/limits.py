"""Control limits whose false alarms are known though mean and scatter are estimated from few recordings.

In control a quantity is normal about an unknown mean, with variance kappa v_i^2: v_i is what the estimation
says of its own error, the unknown kappa what robots do beside it from one recording to the next. Both charts
divide by what the reference period shows of them, so their null distribution depends on nothing but the
numbers of recordings, and is simulated. Limits taken from the normal distribution instead alarm several times
too often (Jensen, Jones-Farmer, Champ and Woodall, J. Quality Technology 38(4), 2006).

    z_i = (x_i - m) / (s sqrt(v_i^2 + 1 / sum 1/v_j^2)),   m, s^2: weighted mean and scatter of the reference
    e_i = (1 - w) e_(i-1) + w z_i                                         (Roberts, Technometrics 1(3), 1959)

The chart of z sees what jumps, that of e (over its own standard deviation) what creeps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError

FloatArray = NDArray[np.float64]
#: Weight of the newest recording in the moving average.
WEIGHT = 0.2
#: Recordings that a reference needs: of fewer nobody knows the scatter.
FEWEST = 5
#: Simulated years that have an alarm, from which a limit is read, and the most years that are simulated.
_EVENTS, _MOST = 200, 400_000
_AT_ONCE = 4_000_000


@dataclass(frozen=True)
class Limits:
    """What |z| and |e| / its standard deviation may be: ``single`` and ``moving``."""

    single: float
    moving: float


@lru_cache(maxsize=64)
def limits(reference: int, year: int, alarm: float) -> Limits:
    """Return limits that a year of ``year`` recordings after ``reference`` ones leaves with probability
    ``alarm`` where nothing changes, half of it by either chart.

    Raises ConfigurationError for fewer than FEWEST reference recordings, or an alarm that would take more
    simulated years than are worth it.
    """
    if reference < FEWEST:
        raise ConfigurationError(
            f"--reference {reference} is too few to know the scatter: give {FEWEST} at least."
        )
    refuse_rare(alarm)
    draws = int(2.0 * _EVENTS / alarm)
    random = np.random.default_rng(20_061)
    highest: list[FloatArray] = []
    for count in _portions(draws, reference + year):
        values = random.standard_normal((count, reference + year))
        first = values[:, :reference]
        scatter = np.std(first, axis=1, ddof=1) * np.sqrt(1.0 + 1.0 / reference)
        z = (values[:, reference:] - first.mean(axis=1)[:, None]) / scatter[:, None]
        highest.append(np.stack([np.abs(z).max(axis=1), np.abs(moving(z)).max(axis=1)]))
    single, creeping = np.quantile(np.concatenate(highest, axis=1), 1.0 - 0.5 * alarm, axis=1)
    return Limits(float(single), float(creeping))


def refuse_rare(alarm: float) -> None:
    """Raise ConfigurationError for an alarm a year and chart that would take too many simulated years."""
    if 2.0 * _EVENTS / alarm > _MOST:
        raise ConfigurationError(
            f"so rare a false alarm ({alarm:.2g} a year and quantity) is not computed: raise --false-alarms, "
            "or fix parameters."
        )


def moving(z: FloatArray) -> FloatArray:
    """Moving averages (..., n) of (..., n) scores, each over its standard deviation were they independent."""
    averages, e = np.empty_like(z), np.zeros(z.shape[:-1])
    for i in range(z.shape[-1]):
        e = (1.0 - WEIGHT) * e + WEIGHT * z[..., i]
        averages[..., i] = e / np.sqrt(WEIGHT / (2.0 - WEIGHT) * (1.0 - (1.0 - WEIGHT) ** (2 * (i + 1))))
    return averages


def _portions(draws: int, length: int) -> list[int]:
    size = max(1, _AT_ONCE // length)
    return [size] * (draws // size) + ([draws % size] if draws % size else [])
