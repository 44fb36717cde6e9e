"""Serialised joint states of one sender: the same bytes each time, but for the stamp and the numbers.

Whoever has examined one of them reads all others in place, with a few comparisons and one unpacking; whoever
sends them writes stamp and numbers in place.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from haptic_teleop_control.recording.cdr_layout import STAMP, find_layout
from haptic_teleop_control.recording.joint_state_cdr import encode
from haptic_teleop_control.recording.series import FIELDS, JointStateSeries

NATIVE = "<" if sys.byteorder == "little" else ">"
PUT_STAMP = struct.Struct(NATIVE + "iI").pack_into
"""Writes a stamp (sec, nanosec) into a message, at STAMP."""


def zeros(joints: Sequence[str], fields: Sequence[str]) -> bytes:
    """A message of zeros for `joints`, stamp and frame empty, that holds `fields` and leaves the others
    empty."""
    values: dict[str, Any] = {field: np.zeros((1, len(joints))) for field in fields}
    never = np.zeros(1, np.int64)
    return encode(JointStateSeries(never, never, tuple(joints), **values))[0].tobytes()


class Template:
    """message: a whole sensor_msgs/JointState in plain CDR. fields: of "position", "velocity", "effort",
    those that are read; each holds a value. at: field -> where its float64 values lie in every message that
    fits.

    Raises ValueError for a message that is none of these, or of another byte order than this machine's.
    """

    def __init__(self, message: bytes, fields: Sequence[str]) -> None:
        layout = find_layout(message)
        if layout.order != NATIVE:
            raise ValueError("it has another byte order than this machine")
        numbers = {
            field: slice(offset, offset + 8 * count)
            for field, (offset, count) in zip(FIELDS, layout.fields, strict=True)
            if count
        }
        if missing := [field for field in fields if field not in numbers]:
            raise ValueError(f"it holds no {', '.join(missing)}")
        self.at = {field: numbers[field] for field in fields}
        stamp = slice(STAMP, STAMP + 8)
        self._size = len(message)
        # Not what fills gaps before aligned values: a sender may leave there whatever was in its memory.
        text = stamp.stop + 4
        frame = range(text, text + struct.unpack_from(NATIVE + "I", message, stamp.stop)[0])
        self._fixed = [(part, message[part]) for part in _runs({*layout.fixed.tolist(), *frame})]
        wanted = sorted((part.start, part.stop) for part in self.at.values())
        form, end = NATIVE + f"{STAMP}xiI", stamp.stop
        for start, stop in wanted:
            form += f"{start - end}x{(stop - start) // 8}d"
            end = stop
        self.read = struct.Struct(form).unpack_from
        """(sec, nanosec, values of `fields` as they lie in the message) of a message that fits."""

    def fits(self, message: object) -> bool:
        """Whether it is a message of the same frame, names and counts."""
        if type(message) is not bytes or len(message) != self._size:
            return False
        for part, expected in self._fixed:  # noqa: SIM110  all() takes twice as long
            if message[part] != expected:
                return False
        return True


def _runs(places: set[int]) -> list[slice]:
    """Neighbouring places together."""
    found: list[slice] = []
    for place in sorted(places):
        if found and found[-1].stop == place:
            found[-1] = slice(found[-1].start, place + 1)
        else:
            found.append(slice(place, place + 1))
    return found
