"""Checksums that a layout may name, over all bytes but the last, which holds the result."""

from __future__ import annotations

import functools
from collections.abc import Callable
from operator import xor

CHECKSUMS: dict[str, Callable[[bytes | bytearray], int] | None] = {
    "none": None,
    "sum8": lambda data: sum(data) & 0xFF,
    "xor8": lambda data: functools.reduce(xor, data, 0),
}
