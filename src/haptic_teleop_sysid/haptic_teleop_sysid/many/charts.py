"""One quantity over many recordings: its reference, its limits, where it leaves them, what it is now."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from .limits import FEWEST, limits, moving

FloatArray = NDArray[np.float64]
#: Probability that the reference's most distant recording is called so where nothing is wrong with it.
_OUTLIER = 0.01


@dataclass(frozen=True)
class Quantity:
    """``values`` and their standard errors ``std`` (n,), NaN where a recording does not tell; ``std`` None
    where nobody knows it. ``logarithmic``: positive, and its logarithm is charted."""

    name: str
    unit: str
    values: FloatArray
    std: FloatArray | None = None
    logarithmic: bool = False


@dataclass(frozen=True)
class Chart:
    """A ``quantity`` against its reference: ``centre`` and ``spread`` (standard deviation of a single
    recording there) on its scale (logarithms for a logarithmic one); ``half`` (n,): single limit about it;
    ``single`` and ``creeping`` (n,): which recordings leave which limit; ``now``: the weighted mean of the
    last recordings (of those since it left the limits, where it is outside), and ``now_std`` of its
    difference from the centre; ``odd``: the reference recording that stands out, None."""

    quantity: Quantity
    centre: float
    spread: float
    half: FloatArray
    score: FloatArray
    average: FloatArray
    single: NDArray[np.bool_]
    creeping: NDArray[np.bool_]
    now: float
    now_std: float
    odd: int | None

    @property
    def outside(self) -> NDArray[np.bool_]:
        """Recordings (n,) that leave either limit."""
        return self.single | self.creeping

    @property
    def first(self) -> int | None:
        """The first of them."""
        found = np.flatnonzero(self.outside)
        return int(found[0]) if len(found) else None

    def shown(self, value: float) -> float:
        """A number on the chart's scale in the quantity's unit."""
        return float(np.exp(value)) if self.quantity.logarithmic else value

    @property
    def change(self) -> float:
        """What it is now relative to the reference, less one; NaN for a reference of zero."""
        if self.quantity.logarithmic:
            return float(np.expm1(self.now - self.centre))
        return (self.now - self.centre) / abs(self.centre) if self.centre else float("nan")


def chart(quantity: Quantity, reference: int, year: int, alarm: float, last: int) -> Chart | None:
    """Return the chart of a quantity against its first ``reference`` recordings, with the `limits` for
    ``year`` recordings a year and ``alarm``; ``last``: how many recordings say what it is now. None where
    fewer than FEWEST of the reference tell it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x = np.log(quantity.values) if quantity.logarithmic else quantity.values.astype(float)
    errors = np.ones(len(x)) if quantity.std is None else quantity.std
    told = np.isfinite(x) & np.isfinite(errors) & (errors > 0.0)
    first = np.flatnonzero(told[:reference])
    if len(first) < FEWEST:
        return None
    allowed = limits(len(first), year, alarm)
    # A recording that is surer of itself than usual does not make robots vary less.
    v = np.maximum(errors, float(np.median(errors[first])))
    weight = 1.0 / v[first] ** 2
    total = float(np.sum(weight))
    centre = float(np.sum(weight * x[first]) / total)
    scatter = float(np.sum(weight * (x[first] - centre) ** 2) / (len(first) - 1))
    # No less than the estimation says of itself, where it says anything.
    scale = np.sqrt(max(scatter, 1.0 if quantity.std is not None else 1e-24))
    spread = scale * np.sqrt(np.where(told, v, np.nan) ** 2 + 1.0 / total)
    score = np.where(told, (x - centre) / spread, np.nan)
    watched = np.flatnonzero(told)
    watched = watched[watched >= reference]
    single, creeping, average = np.zeros(len(x), bool), np.zeros(len(x), bool), np.full(len(x), np.nan)
    single[watched] = np.abs(score[watched]) > allowed.single
    # What jumped once, and is told as that, is not to be remembered as if it were creeping.
    average[watched] = moving(np.clip(score[watched], -allowed.single, allowed.single))
    creeping[watched] = np.abs(average[watched]) > allowed.moving
    final = watched[-last:] if len(watched) else first
    if len(watched) and (single | creeping)[watched[-1]]:  # what was before it left says nothing of now
        within = np.flatnonzero(~(single | creeping)[final])
        final = final[within[-1] + 1 :] if len(within) else final
    while len(final) > 1 and _still_moves(x[final], scale * v[final]):
        final = final[1:]
    own = 1.0 / v[final] ** 2
    now = float(np.sum(own * x[final]) / np.sum(own))
    now_std = float(scale * np.sqrt(1.0 / np.sum(own) + 1.0 / total))
    typical, half = float(scale * np.median(v[first])), allowed.single * spread
    odd = _odd(np.flatnonzero(told[:reference]), (x - centre) / np.where(told, v, np.nan))
    return Chart(quantity, centre, typical, half, score, average, single, creeping, now, now_std, odd)


def _still_moves(values: FloatArray, errors: FloatArray) -> bool:
    """Whether values (n,) differ by more than their errors say (chi-square): the mean of what creeps is where
    it was some time ago."""
    weight = 1.0 / errors**2
    mean = float(np.sum(weight * values) / np.sum(weight))
    apart = float(np.sum(weight * (values - mean) ** 2))
    return apart > float(scipy.special.chdtri(len(values) - 1, _OUTLIER))


def _odd(first: NDArray[np.intp], left: FloatArray) -> int | None:
    """The reference recording that stands out of its fellows, by Grubbs' test (Technometrics 11(1), 1969)."""
    n, values = len(first), left[first]
    spread = float(np.std(values, ddof=1))
    if spread == 0.0:
        return None
    most = int(np.argmax(np.abs(values - values.mean())))
    quantile = float(scipy.special.stdtrit(n - 2, 1.0 - _OUTLIER / (2 * n))) ** 2
    limit = (n - 1) / np.sqrt(n) * np.sqrt(quantile / (n - 2 + quantile))
    return int(first[most]) if abs(values[most] - values.mean()) / spread > limit else None


def first_outside(charts: Sequence[Chart], events: Sequence[int]) -> int | None:
    """The first recording that leaves any chart's limits, or is among the ``events``."""
    found = [c.first for c in charts if c.first is not None] + list(events)
    return min(found) if found else None
