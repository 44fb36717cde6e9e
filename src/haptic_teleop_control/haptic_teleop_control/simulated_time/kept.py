"""What recorders have kept of what was published: simulated time does not run far ahead of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from haptic_teleop_control.simulated_time.messages import RECORDER, Member
from haptic_teleop_control.simulated_time.stamps import ORIGIN

LEAD = 1.0
"""s that time may be ahead of what a recorder has kept, at most."""
UNKEPT = 300
"""Samples on their way to a recorder, at most: the middleware's shared memory holds some 500 messages between
two processes. What is beyond that gets lost, and is repaired seconds later (measured: simulated time under
load ran at 0.7 times real time, and at 2.4 times with this limit)."""
NEVER = 1 << 62
"""ns, later than any stamp."""


def longest_lead(samples_per_second: float) -> int:
    """ns that time may be ahead of what a recorder has kept, where so many samples are published."""
    return round(1e9 * min(LEAD, UNKEPT / max(UNKEPT, samples_per_second)))


class Kept:
    """The newest stamp (ns) that each recorder has kept of each topic."""

    def __init__(self) -> None:
        self._kept: dict[str, dict[str, int]] = {}  # recorder -> topic -> newest stamp
        self._by_all = 0  # stamp up to which there is nothing to look for

    def take(self, recorder: str, stamps: Mapping[str, int]) -> None:
        """A recorder says what it has kept: topic -> newest stamp."""
        self._kept[recorder] = dict(stamps)

    def of(self, recorders: Iterable[str]) -> dict[str, dict[str, int]]:
        """Recorder -> topic -> newest stamp."""
        return {name: self._kept.get(name, {}) for name in recorders}

    def look_again(self) -> None:
        """Forget that all have kept anything: another one has joined."""
        self._by_all = 0

    def late(
        self,
        members: Iterable[Member],
        published: Callable[[], Mapping[str, int]],
        limit: int,
        all_of_it: bool,
    ) -> list[str]:
        """Names of the recorders among `members` that have not kept what was published up to `limit` (ns), or
        all of it. published(): topic -> newest stamp; asked only where the answer is not known already."""
        if limit <= self._by_all and not all_of_it:
            return []
        newest_of = published()
        late: list[str] = []
        lowest = NEVER
        for member in members:
            if member.kind != RECORDER:
                continue
            kept = self._kept.get(member.name, {})
            topics = [topic for topic in member.topics if topic in newest_of]
            both = [(kept.get(topic, ORIGIN - 1), newest_of[topic]) for topic in topics]
            if any(stamp < (newest if all_of_it else min(newest, limit)) for stamp, newest in both):
                late.append(member.name)
            lowest = min(lowest, min((stamp for stamp, _ in both), default=limit))
        self._by_all = lowest
        return late
