"""Which samples come next: plants and sources at their rates, packets of the link when they arrive."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field

from haptic_teleop_control.simulated_time.messages import ANSWERER, LINK, PLANT, SOURCE, Delivery, Member
from haptic_teleop_control.simulated_time.stamps import ORIGIN, sample_count, sample_stamp


@dataclass
class _Sampled:
    """A plant or source; sample k is its next, `last` the stamp of the one before."""

    member: Member
    rank: int
    limit: float
    k: int = 0
    last: int = ORIGIN - 1
    silent: bool = False
    published: int = ORIGIN - 1
    next: int | None = ORIGIN

    def advance(self) -> None:
        """Its next sample has been granted."""
        assert self.next is not None
        self.last = self.next
        if not self.silent:
            self.published = self.next
        self.k += 1
        self.next = sample_stamp(self.k, self.member.rate) if self.k < self.limit else None


@dataclass(frozen=True)
class Grant:
    """What one tick holds; see `messages.Tick`."""

    stamp: int
    due: tuple[str, ...]
    states: tuple[str, ...]
    newest: dict[str, int] = field(default_factory=dict)
    deliveries: tuple[Delivery, ...] = ()


class Schedule:
    """Grants in order of time; where samples coincide, sources first, then plants in the order in which they
    are answered. With a link those go singly, because what answers the first may arrive before the second.

    members: everybody who takes part. duration: s, samples at or after it are not granted; 0: no end.
    """

    def __init__(self, members: Iterable[Member], duration: float = 0.0) -> None:
        members = list(members)
        self.answered = list(
            itertools.chain.from_iterable(m.topics for m in members if m.kind == ANSWERER)
        )
        self._singly = any(m.kind == LINK for m in members)
        self._sampled = [
            _Sampled(
                member,
                self._rank(member),
                sample_count(member.rate, duration) if duration else 1e18,
                silent=member.silent,
            )
            for member in members
            if member.kind in (PLANT, SOURCE)
        ]
        self._sampled.sort(key=lambda sampled: sampled.rank)
        self._under_way: list[tuple[int, int, int, str]] = []  # arrival, rank of the way, sent, way
        self._ways = [way for m in members if m.kind == LINK for way in m.topics]

    def _rank(self, member: Member) -> int:
        if member.kind == SOURCE:
            return -1
        return self.answered.index(member.topic) if member.topic in self.answered else len(self.answered)

    @property
    def next_stamp(self) -> int | None:
        """Of the next grant; None at the end."""
        return min((s.next for s in self._sampled if s.next is not None), default=None)

    def last_stamps(self) -> dict[str, int]:
        """Topic of a plant or source -> stamp of its newest sample that is published."""
        return {s.member.topic: s.published for s in self._sampled if s.published >= ORIGIN}

    @property
    def samples_per_second(self) -> float:
        """Of all topics together: what is published, its answers, and their way through a link."""
        with_answer = 4.0 if self._singly else 2.0
        answered = set(self.answered)
        return sum(
            s.member.rate * (with_answer if s.member.topic in answered else 1.0) for s in self._sampled
        )

    def silence(self, name: str, silent: bool) -> None:
        """Whether the next sample of a plant is published."""
        for sampled in self._sampled:
            if sampled.member.name == name:
                sampled.silent = silent

    def _is_answered(self, sampled: _Sampled) -> bool:
        plant = sampled.member.kind == PLANT and not sampled.silent
        return plant and sampled.member.topic in self.answered

    def under_way(self, way: str, sent: int, arrivals: Iterable[int]) -> None:
        """The link has taken a packet whose copies arrive at these stamps."""
        for arrival in arrivals:
            heapq.heappush(self._under_way, (arrival, self._ways.index(way), sent, way))

    def grant(self) -> Grant:
        """The next one; to be called when there is a `next_stamp`."""
        stamp = self.next_stamp
        assert stamp is not None
        due, states = [], []
        for sampled in self._sampled:
            if sampled.next != stamp:
                continue
            answered = self._is_answered(sampled)
            if answered and states and self._singly:
                break
            due.append(sampled.member.name)
            if answered:
                states.append(sampled.member.topic)
            sampled.advance()
        newest = {s.member.topic: s.last for s in self._sampled if s.member.kind == SOURCE and s.k}
        deliveries = []
        while states and self._under_way and self._under_way[0][0] <= stamp:
            arrival, _, sent, way = heapq.heappop(self._under_way)
            deliveries.append(Delivery(way, sent, arrival))
        return Grant(stamp, tuple(due), tuple(states), newest, tuple(deliveries))
