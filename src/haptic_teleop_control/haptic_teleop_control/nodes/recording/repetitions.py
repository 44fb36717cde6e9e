"""What is said again in simulated time, because an answer to it was lost."""

from __future__ import annotations

from collections import deque

REMEMBERED = 1000
"""Stamps; what one tick delivers is said again together."""


class Repetitions:
    """The stamps that one topic had last. They need not increase: a link may let packets overtake others."""

    def __init__(self) -> None:
        self._order: deque[int] = deque()
        self._stamps: set[int] = set()
        self.newest = 0

    def is_one(self, stamp: int) -> bool:
        """Whether the message with this stamp is there already; remembers it otherwise."""
        if stamp in self._stamps:
            return True
        self._stamps.add(stamp)
        self._order.append(stamp)
        self.newest = max(self.newest, stamp)
        if len(self._order) > REMEMBERED:
            self._stamps.remove(self._order.popleft())
        return False
