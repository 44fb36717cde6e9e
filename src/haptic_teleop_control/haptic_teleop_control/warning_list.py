"""What is worth a warning without being a fault: what stands, and what has grown since the last look."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

DEADLINE_SHARE = 0.01
"""Share of the periods, or of the samples, that may be missed before that is worth a warning."""

REALTIME_REFUSED = (
    "real-time priority is refused, so samples may be late under load; `haptic-teleop doctor` says how to "
    "allow it"
)


@dataclass
class _Counter:
    count: Callable[[], int]
    sentence: str
    of: Callable[[], int] | None
    share: float
    last: int = 0
    last_of: int = 0

    def grown(self) -> tuple[int, int]:
        count, of = self.count(), 0 if self.of is None else self.of()
        grown = (count - self.last, of - self.last_of)
        self.last, self.last_of = count, of
        return grown


class Warnings:
    """Collects sentences. `state` may be called from any thread, `take` from one."""

    def __init__(self) -> None:
        self._counters: list[_Counter] = []
        self._standing: dict[str, str] = {}

    def watch(
        self, count: Callable[[], int], sentence: str, of: Callable[[], int] | None = None, share: float = 0.0
    ) -> None:
        """Warns when `count()` has grown since the last `take`: "<by how much> <sentence>". With `of`, only
        when it has grown by more than `share` (0 to 1) of what `of()` has."""
        counter = _Counter(count, sentence, of, share)
        counter.grown()
        self._counters.append(counter)

    def state(self, key: str, sentence: str) -> None:
        """Warns of `sentence` from now on, in place of what was stated as `key` before; empty: no more."""
        if sentence:
            self._standing[key] = sentence
        else:
            self._standing.pop(key, None)

    def take(self) -> list[str]:
        """The warnings of now; what has grown counts from now on anew."""
        found = list(self._standing.values())
        for counter in self._counters:
            grown, of = counter.grown()
            if grown > 0 and grown > counter.share * of:
                share = f" of {of}" if counter.of is not None else ""
                found.append(f"{grown}{share} {counter.sentence}")
        return found
