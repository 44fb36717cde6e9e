"""Where each value of a serialised sensor_msgs/JointState lies, found once for all messages that share a
layout.

A message is the RTPS encapsulation header (4 bytes: representation, options) and the fields in plain CDR
(OMG CDR 1.2 / DDS-RTPS 9.4, XCDR version 1): primitives aligned to their size counted from the end of that
header, strings with length and final NUL, sequences with a 32-bit count, the elements aligned only if there
are any.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

ENCAPSULATION = 4
LITTLE, BIG = 0x0001, 0x0000
STAMP = 4  # offset of header.stamp: int32 sec, uint32 nanosec


@dataclass(frozen=True)
class Layout:
    """The layout of one message: byte order ('<' or '>'), strings, and for position, velocity and effort the
    offset
    and the number of values. ``fixed`` holds the offsets of all bytes that must be equal in a message of the
    same layout (lengths, counts, names); stamp, values, padding and the text of the frame are free."""

    order: str
    frame_id: str
    names: tuple[str, ...]
    fields: tuple[tuple[int, int], tuple[int, int], tuple[int, int]]
    fixed: NDArray[np.intp]
    size: int


class _Cursor:
    """Walks one message and notes which bytes are structure."""

    def __init__(self, message: bytes, order: str) -> None:
        self.message, self.order, self.at = message, order, ENCAPSULATION
        self.fixed: list[range] = [range(2)]

    def align(self, size: int) -> None:
        self.at += -(self.at - ENCAPSULATION) % size

    def take(self, size: int) -> int:
        start, self.at = self.at, self.at + size
        if self.at > len(self.message):
            raise ValueError(f"it ends after {len(self.message)} bytes, inside a field that needs {self.at}")
        return start

    def count(self) -> int:
        self.align(4)
        start = self.take(4)
        self.fixed.append(range(start, self.at))
        return struct.unpack_from(self.order + "I", self.message, start)[0]

    def string(self, free: bool = False) -> str:
        length = self.count()
        start = self.take(length)
        if not free:
            self.fixed.append(range(start, self.at))
        return self.message[start : self.at].rstrip(b"\0").decode()

    def doubles(self) -> tuple[int, int]:
        count = self.count()
        if not count:
            return self.at, 0
        self.align(8)
        return self.take(8 * count), count


def find_layout(message: bytes) -> Layout:
    """The layout of ``message``; ValueError with a sentence when it is no whole JointState in plain CDR."""
    if len(message) < ENCAPSULATION:
        raise ValueError(f"it has only {len(message)} bytes")
    kind = int.from_bytes(message[:2], "big")
    if kind not in (LITTLE, BIG):
        raise ValueError(f"its encapsulation 0x{kind:04x} is not plain CDR")
    cursor = _Cursor(message, "<" if kind == LITTLE else ">")
    cursor.take(8)
    try:
        frame_id = cursor.string(free=True)
        number = cursor.count()
        if number > len(message):
            raise ValueError(f"it announces {number} names in {len(message)} bytes")
        names = tuple(cursor.string() for _ in range(number))
    except UnicodeDecodeError:
        raise ValueError("a name in it is not UTF-8") from None
    fields = (cursor.doubles(), cursor.doubles(), cursor.doubles())
    # Middleware may round the length up to a multiple of four; more than that is another type of message.
    if len(message) - cursor.at > 3:
        raise ValueError(f"{len(message) - cursor.at} bytes are left over after its last field")
    fixed = np.fromiter((i for part in cursor.fixed for i in part), np.intp)
    return Layout(cursor.order, frame_id, names, fields, fixed, len(message))
