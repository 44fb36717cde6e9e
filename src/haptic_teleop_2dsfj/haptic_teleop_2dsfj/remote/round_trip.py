"""How long datagrams are on their way there and back: all of a session, in bins of constant relative
width."""

from __future__ import annotations

import math
from itertools import accumulate

SHORTEST, PER_DECADE, DECADES = 1e-6, 50, 7
"""s; 1 µs to 10 s in steps of 4.7 %."""


class RoundTrips:
    """`add` costs no allocation. largest: s."""

    def __init__(self) -> None:
        self._bins = [0] * (PER_DECADE * DECADES + 1)
        self.count = 0
        self.largest = 0.0

    def add(self, seconds: float) -> None:
        """One more; what is below the first bin or above the last counts there."""
        place = math.ceil(PER_DECADE * math.log10(max(seconds, SHORTEST) / SHORTEST))
        self._bins[min(place, len(self._bins) - 1)] += 1
        self.count += 1
        self.largest = max(self.largest, seconds)

    def quantile(self, share: float) -> float:
        """s, at or above which no more than 1 - `share` of all are: the upper edge of a bin; nan before the
        first."""
        if not self.count:
            return math.nan
        wanted = math.ceil(share * self.count)
        place = next(place for place, passed in enumerate(accumulate(self._bins)) if passed >= wanted)
        return min(SHORTEST * 10.0 ** (place / PER_DECADE), self.largest)

    def __str__(self) -> str:
        """Median, tail and largest, in ms; empty before the first."""
        if not self.count:
            return ""
        shares = (self.quantile(share) * 1e3 for share in (0.5, 0.99, 0.999))
        return "{:.3f}, {:.3f}, {:.3f}, {:.3f}".format(*shares, self.largest * 1e3)
