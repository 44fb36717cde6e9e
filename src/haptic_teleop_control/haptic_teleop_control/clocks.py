"""The clock a device keeps: the steady one of the machine, or one that only a test or a replay moves."""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """Time in ns that never jumps."""

    def now(self) -> int: ...

    def sleep_until(self, moment: int) -> None: ...


class SteadyClock:
    """The machine's monotonic clock. By the performance counter, which on Linux is the same clock: on
    Windows the other one goes in steps of 16 ms."""

    def now(self) -> int:
        return time.perf_counter_ns()

    def sleep_until(self, moment: int) -> None:
        """Returns at `moment` (ns) or at once when that is past."""
        wait = moment - time.perf_counter_ns()
        if wait > 0:
            time.sleep(wait * 1e-9)


class VirtualClock:
    """A clock that stands still unless somebody sleeps on it or calls `advance`."""

    def __init__(self, start: int = 0) -> None:
        self._now = start

    def now(self) -> int:
        return self._now

    def sleep_until(self, moment: int) -> None:
        self._now = max(self._now, moment)

    def advance(self, seconds: float) -> None:
        """Lets `seconds` go by, as a stalled program does."""
        self._now += round(seconds * 1e9)
