"""Paths as a reader tells them apart: by their shortest ending."""

from __future__ import annotations

from collections.abc import Iterable


def shortest_ending(name: str, among: Iterable[str]) -> str:
    """Return the shortest ending of a path that no other one of ``among`` shares; a path whole where another
    is the same."""
    parts = name.replace("\\", "/").rstrip("/").split("/")
    others = [other.replace("\\", "/").rstrip("/") for other in among]
    for count in range(1, len(parts) + 1):
        ending = "/".join(parts[-count:])
        if ending and sum(other == ending or other.endswith("/" + ending) for other in others) == 1:
            return ending
    return name
