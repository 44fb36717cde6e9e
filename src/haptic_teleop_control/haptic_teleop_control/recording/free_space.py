"""How long the disk will last, said before it is too late."""

from __future__ import annotations

AHEAD = 600.0
"""s before the end of the free space from which on it is worth a warning."""

USUAL_RATE = 1e6
"""B/s that a recording of both robots takes, until the rate has been measured."""

SHORTEST = 10.0
"""s over which the rate has to be measured at least."""
LONGEST = 60.0
"""s after which it is measured anew."""


class FreeSpace:
    """minimum: B that stay free; the recording ends there."""

    def __init__(self, minimum: float) -> None:
        self._minimum = minimum
        self._rate = USUAL_RATE
        self._since: tuple[float, float] | None = None

    def warning(self, now: float, free: float) -> str:
        """A sentence when `free` (B, at `now`, s) lasts for less than AHEAD at the rate of late, whoever
        writes there; else empty."""
        if self._since is None:
            self._since = (now, free)
        elapsed = now - self._since[0]
        if elapsed >= SHORTEST:
            self._rate = max(0.0, (self._since[1] - free) / elapsed)
        if elapsed >= LONGEST:
            self._since = (now, free)
        left = max(0.0, free - self._minimum) / max(self._rate, 1.0)
        if left >= AHEAD:
            return ""
        return (
            f"the disk lasts for about {left:.0f} s more ({free / 1e6:.0f} MB are free, a recording ends at "
            f"{self._minimum / 1e6:.0f} MB): free space"
        )
