"""From raw encoders to angles: counters that wrap, reports that were lost, and jumps that no hand makes."""

from __future__ import annotations

from collections.abc import Sequence


class Unwrapper:
    """Encoders that wrap, each `bits` wide: `step` returns how far each has moved since the last call.
    absolute: `total` begins at the first sample's value and not at zero."""

    def __init__(self, bits: Sequence[int], absolute: bool = False) -> None:
        self._absolute = absolute
        self._spans = [1 << width for width in bits]
        self._last: list[int] | None = None
        self.total = [0] * len(self._spans)

    def step(self, raw: Sequence[int]) -> list[int]:
        """Changes (n,), counts; the first call gives zeros. `total` counts from the first sample."""
        if self._last is None:
            self._last = list(raw)
            self.total = list(raw) if self._absolute else self.total
        changes = [
            (now - last + span // 2) % span - span // 2
            for now, last, span in zip(raw, self._last, self._spans, strict=True)
        ]
        self._last = list(raw)
        self.total = [total + change for total, change in zip(self.total, changes, strict=True)]
        return changes

    def forget(self) -> None:
        """The next sample is the first again."""
        self._last = None
        self.total = [0] * len(self.total)


class PacketCounter:
    """How many periods lie between two reports, from the counter that the device sends with them.

    `lost` counts reports that never arrived, `repeated` those that came twice, `stale` those that are older
    than what has come already, by up to `oldest` periods, `restarts` jumps by more than that or forwards by
    more than `farthest`: the device counts anew, and nothing is known of the time in between.
    """

    def __init__(self, bits: int, farthest: int = 60_000, oldest: int = 1000) -> None:
        self._span = 1 << bits
        most = max(1, self._span // 2 - 1)
        self._farthest, self._oldest = min(farthest, most), min(oldest, most)
        self._last: int | None = None
        self.lost = self.repeated = self.stale = self.restarts = 0

    def step(self, counter: int) -> int:
        """Periods since the last report: 0 for one that came before or is older; 1 is normal, more after
        losses; -1 after a restart, with this report as the first."""
        if self._last is None:
            self._last = counter
            return 1
        periods = (counter - self._last) % self._span
        if periods == 0:
            self.repeated += 1
            return 0
        if self._span - periods <= self._oldest and periods > self._farthest:
            self.stale += 1
            return 0
        self._last = counter
        if periods > self._farthest:
            self.restarts += 1
            return -1
        self.lost += periods - 1
        return periods

    def forget(self) -> None:
        """The next report is the first again."""
        self._last = None
