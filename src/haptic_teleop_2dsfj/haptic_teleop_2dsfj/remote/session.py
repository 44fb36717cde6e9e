"""The server's one client: what is known of it, and which of its datagrams are commands."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote.expiry import Expiry
from haptic_teleop_2dsfj.remote.link import Address
from haptic_teleop_2dsfj.remote.sequence import Sequence

ROUNDING = 1e-9
"""Relative, by which a command at the limit may seem to be above it."""


@dataclass
class Session:
    """fresh: when the client last gave a current for a young sample; heard: when it last said anything; echo:
    its stamp then; answered: stamp of the sample that it last answered. highest: V of either output."""

    key: bytes
    nonce: bytes
    address: Address
    fresh: int
    heard: int
    highest: tuple[float, ...]
    incoming: Sequence = field(default_factory=Sequence)
    sent: int = 0
    echo: int = 0
    answered: int = 0
    rearmed: int = 0
    expired: Expiry = Expiry.NONE

    def command(self, data: bytes, newest: int) -> d.Command | d.Trouble:
        """`data` as the session's next command, or why it is none. newest: stamp of the last sample."""
        found = d.unpack(data, self.key)
        if isinstance(found, d.Trouble):
            return found
        if not isinstance(found, d.Command):
            return d.Trouble.UNEXPECTED
        trouble = self.incoming.take(found.sequence)
        if trouble is not None:
            return trouble
        for value, bound in zip((found.first, found.second), self.highest, strict=True):
            if not math.isfinite(value) or abs(value) > bound * (1.0 + ROUNDING):
                return d.Trouble.VALUE
        return d.Trouble.VALUE if found.answers > newest else found

    def state(self, board: Board, stamp: int, passed: int, now: int) -> bytes:
        """The datagram of the sample that was read at `stamp`, to be sent `now`."""
        self.sent += 1
        state = d.State(
            self.sent, stamp, now, self.echo, self.heard, passed, self.rearmed, board.enabled, self.expired,
            tuple(board.counts.tolist()), tuple(board.sense_volts.tolist()),
            tuple(board.switch_levels.tolist()),
        )  # fmt: skip
        return d.pack(state, self.key)

    def greeted(self, data: bytes, shared: bytes) -> bool:
        """Whether `data` repeats the client's own greeting, whose answer was slow."""
        kind = d.kind_of(data)
        if self.echo or kind not in (d.Hello, d.Start):
            return False
        found = d.unpack(data, shared if kind is d.Hello else self.key)
        return isinstance(found, (d.Hello, d.Start)) and found.nonce == self.nonce
