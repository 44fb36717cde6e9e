"""From raw encoders to angles: counters that wrap, reports that were lost, and jumps that no hand makes."""

from __future__ import annotations

from collections.abc import Sequence


class Unwrapper:
    """Encoders of `bits` bits that wrap: `step` returns how far each has moved since the last call."""

    def __init__(self, n: int, bits: int) -> None:
        self._span = 1 << bits
        self._last: list[int] | None = None
        self.total = [0] * n

    def step(self, raw: Sequence[int]) -> list[int]:
        """Changes (n,), counts; the first call gives zeros. `total` counts from the first sample."""
        half = self._span // 2
        if self._last is None:
            self._last = list(raw)
        changes = [(now - last + half) % self._span - half for now, last in zip(raw, self._last, strict=True)]
        self._last = list(raw)
        self.total = [total + change for total, change in zip(self.total, changes, strict=True)]
        return changes

    def forget(self) -> None:
        """The next sample is the first again."""
        self._last = None
        self.total = [0] * len(self.total)


class PacketCounter:
    """How many periods lie between two reports, from the counter that the device sends with them.

    `lost` counts reports that never arrived, `repeated` those that came twice, `restarts` jumps backwards or
    beyond `farthest` periods, after which nothing is known of the time in between.
    """

    def __init__(self, bits: int, farthest: int = 1000) -> None:
        self._span = 1 << bits
        self._farthest = farthest
        self._last: int | None = None
        self.lost = self.repeated = self.restarts = 0

    def step(self, counter: int) -> int:
        """Periods since the last report: 0 for the same report again, 1 is normal, more after losses."""
        last, self._last = self._last, counter
        if last is None:
            return 1
        periods = (counter - last) % self._span
        if periods == 0:
            self.repeated += 1
        elif periods > self._farthest:
            self.restarts += 1
            return 1
        else:
            self.lost += periods - 1
        return periods

    def forget(self) -> None:
        """The next report is the first again."""
        self._last = None
