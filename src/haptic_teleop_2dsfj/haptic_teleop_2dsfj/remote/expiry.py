"""Why a board server took the amplifier off: a number in each State, a sentence for who reads it."""

from __future__ import annotations

from enum import IntEnum


class Expiry(IntEnum):
    """Why the amplifier was taken off; latched until the client asks for it anew."""

    NONE = 0
    SILENCE = 1
    DELAY = 2
    BOARD = 3


def expiry_text(why: int, watchdog: float) -> str:
    """What made the amplifier go off, as an operator reads it."""
    return {
        Expiry.SILENCE: f"the board server had no command for {watchdog:g} s",
        Expiry.DELAY: f"a command answered a sample that was older than {watchdog:g} s: the link is too slow",
        Expiry.BOARD: "the board's own watchdog expired: the board server stalled",
    }.get(Expiry(why), "")
