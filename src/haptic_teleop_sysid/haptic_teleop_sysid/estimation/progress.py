"""How an estimate tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""(what is done now, share that is done, 0 to 1)."""


def silent(what: str, share: float) -> None:
    """Nobody wants to know."""
