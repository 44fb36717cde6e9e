"""Whether a board's samples keep step with the computer's steady clock.

The board says how many samples have passed, the steady clock for how long. A reader comes late by chance but
never early, so that the least lateness of many samples

    lateness = (moment - first moment) - samples dt

stays where it is. It steps by whole periods when samples get lost without a word, and grows or falls for ever
when the board samples at another rate than it was asked for.
"""

from __future__ import annotations

import math

WINDOW = 0.1
"""s of samples of which the least lateness counts."""

SETTLING = 2
"""Windows after a start that tell what the least lateness is here."""

CONFIRMED = 3
"""Windows in a row that must differ: none of some 150 samples in a row was read in time otherwise."""

SUSPICIOUS = 0.5
"""Of a period, by which a window may differ."""

TOLERANCE = 1e-3
"""Relative error of the board's rate that is followed: ten times what the worst quartz makes of both
clocks."""


class SampleClock:
    """dt: s between two samples. lag: s by which the samples came to lag behind the steady clock (negative:
    run ahead of it), of the last window."""

    def __init__(self, dt: float) -> None:
        self._dt = dt * 1e9
        self._reads = max(10, round(WINDOW / dt))
        self._followed = TOLERANCE * self._reads * self._dt
        self.restart()

    def restart(self) -> None:
        """Nothing is known, as before the first sample."""
        self._first: int | None = None
        self._taken = self._read = self._windows = self._suspicious = 0
        self._least = self._usual = math.inf
        self.lag = 0.0

    def step(self, moment: int, periods: int) -> float | None:
        """A sample was read at `moment`, ns of the steady clock, `periods` after the last one. Returns `lag`
        once the samples have surely lost step, and begins anew; None otherwise."""
        if self._first is None:
            self._first = moment
        else:
            self._taken += periods
        self._least = min(self._least, self._lateness(moment))
        self._read += 1
        if self._read < self._reads:
            return None
        least, self._least, self._read = self._least, math.inf, 0
        self._windows += 1
        if self._windows <= SETTLING:
            self._usual = min(self._usual, least)
            return None
        shift = least - self._usual
        self.lag = shift * 1e-9
        if abs(shift) <= SUSPICIOUS * self._dt:
            self._suspicious = 0
            self._usual += min(max(shift, -self._followed), self._followed)
            return None
        self._suspicious += 1
        if self._suspicious < CONFIRMED:
            return None
        found = self.lag
        self.restart()
        self.lag = found
        return found

    def waiting(self, moment: int) -> int:
        """Samples that the board must have taken by `moment` and that nobody has read."""
        usual = min(self._usual, self._least)
        if self._first is None or math.isinf(usual):
            return 0
        return max(0, math.floor((self._lateness(moment) - usual) / self._dt))

    def _lateness(self, moment: int) -> float:
        return moment - (self._first or 0) - self._taken * self._dt
