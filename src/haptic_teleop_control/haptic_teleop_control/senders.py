"""One sender per stream: a second one is noticed by the id that the middleware gives each publisher.

Two senders alive at once show themselves by taking turns: A, B, A. Nothing else proves it. B alone, after A,
may be A's successor, and what the graph lists is no sign of life: a killed process stays listed for some
20 s. So B is left out while A may still be alive, and A's next sample makes two senders of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping

LOOK_AGAIN = 20_000_000
"""ns between two looks at the graph on account of one topic."""

NAMELESS = "a node whose name is not known"

REMEMBERED = 8
"""Senders that were replaced and would be noticed if they came back."""


class SenderGuard:
    """Admits one sender's samples; reports when two send.

    silence: ns without a sample after which the sender counts as gone, so that another may take its place.
    publishers: id -> node name of the topic's publishers, as the graph knows them now, empty for a name that
    it does not know; called only when a sample does not come from the sender. report: called with a text that
    names both, once a turn.

    sole: the sender, while nobody else is heard; a sample of it needs no `admit`, only `heard` set (ns).
    refused: samples of other senders that were left out.
    """

    __slots__ = (
        "_former",
        "_named",
        "_next_look",
        "_other",
        "_publishers",
        "_report",
        "_sender",
        "_silence",
        "_text",
        "heard",
        "refused",
        "sole",
    )

    def __init__(
        self, silence: int, publishers: Callable[[], Mapping[bytes, str]], report: Callable[[str], None]
    ) -> None:
        self.sole: bytes | None = None
        self.heard = 0
        self.refused = 0
        self._silence, self._publishers, self._report = silence, publishers, report
        self._sender: bytes | None = None
        self._other = b""
        self._former: deque[bytes] = deque(maxlen=REMEMBERED)
        self._next_look = 0
        self._named: tuple[bytes, bytes] | None = None
        self._text = ""

    def admit(self, sender: bytes, now: int) -> bool:
        """Whether a sample of `sender`, received at `now` (ns, steady), may be used.

        The first sender is admitted, and whoever comes when it is gone: silent for longer than `silence`, or
        no longer in the graph while the new one is.
        """
        if sender == self._sender:
            self.sole, self.heard = sender, now
            self._report(self._both(sender, self._other, now))
            return True
        if self._sender is None:
            self._replace(sender, now)
            return True
        returned = sender in self._former
        gone = now - self.heard > self._silence or (not returned and self._unlisted(sender, now))
        if returned:  # it was not gone after all, only slow or stopped
            self._report(self._both(self._sender, sender, now))
        if gone:
            self._replace(sender, now)
            return True
        self.refused += 1
        self.sole, self._other = None, sender
        return False

    @property
    def sender(self) -> bytes | None:
        """Whose samples are taken now; None before the first."""
        return self._sender

    def forget(self) -> None:
        """After a reset: another sender that was heard before does not count any more. The sender stays."""
        self.sole = self._sender
        self._former.clear()

    def _replace(self, sender: bytes, now: int) -> None:
        if self._sender is not None:
            self._former.append(self._sender)
        if sender in self._former:
            self._former.remove(sender)
        self._sender = self.sole = sender
        self.heard = now

    def _unlisted(self, successor: bytes, now: int) -> bool:
        if now < self._next_look:
            return False
        self._next_look = now + LOOK_AGAIN
        listed = self._publishers()
        return successor in listed and self._sender not in listed

    def _both(self, first: bytes, second: bytes, now: int) -> str:
        # A look at the graph for each pair, not for each sample; it may learn the names a little later.
        if self._named != (first, second) or (NAMELESS in self._text and now >= self._next_look):
            self._next_look = now + LOOK_AGAIN
            self._named, self._text = (first, second), _names(self._publishers(), first, second)
        return self._text


def _names(listed: Mapping[bytes, str], first: bytes, second: bytes) -> str:
    names = [listed.get(sender) or NAMELESS for sender in (first, second)]
    if names[0] == names[1] != NAMELESS:
        return f"{names[0]} ({first.hex()}) and another of this name ({second.hex()})"
    return f"{names[0]} and {names[1]}"
