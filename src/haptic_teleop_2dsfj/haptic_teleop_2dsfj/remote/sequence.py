"""Numbers that must grow, so that nothing is taken twice or after what came later."""

from __future__ import annotations

from haptic_teleop_2dsfj.remote.datagrams import Trouble


class Sequence:
    """Numbers that must grow: each of one direction of one session. lost: numbers that never came."""

    REMEMBERED = 64

    def __init__(self) -> None:
        self._last, self._seen = 0, 1
        self.lost = 0

    def take(self, number: int) -> Trouble | None:
        """None for the next one, or one after a gap."""
        ahead = number - self._last
        if ahead > 0:
            self.lost += ahead - 1
            self._seen = (
                (self._seen << ahead | 1) & (1 << self.REMEMBERED) - 1 if ahead < self.REMEMBERED else 1
            )
            self._last = number
            return None
        if -ahead < self.REMEMBERED and not self._seen >> -ahead & 1:
            return Trouble.REORDERED
        return Trouble.DUPLICATED
