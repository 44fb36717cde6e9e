"""The memory that the transport shares with its frame in the servo thread (`hd_frame.py`), from the
transport's side: torques go in, reports come out, and somebody who waits for one is woken."""

from __future__ import annotations

import os
import select
import struct
from contextlib import suppress
from ctypes import c_int

from haptic_teleop_omni.transports import hd_frame as frame

OUTPUT = struct.Struct("<iiii")


class Exchange:
    """words: the memory, of 4 bytes each; address: where it begins."""

    def __init__(self) -> None:
        self._block = frame.block()
        self.words = self._block.data
        self.address = int(self._block.ctypes.data)
        self._bytes = self.words.cast("B")
        self._event = -1
        self._poll = select.poll()
        self._taken = self._answers = 0

    def begin(self, handle: int, style: int, in_well: int, watchdog: float, single: bool) -> None:
        """Empties the memory for the device `handle`. watchdog: s. single: one frame for each request."""
        self._block[:] = 0
        self._taken = self._answers = 0
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._poll = select.poll()
        self._poll.register(self._event, select.POLLIN)
        words = self.words
        words[frame.HANDLE], words[frame.STYLE] = c_int(handle).value, style
        words[frame.IN_WELL], words[frame.EVENT] = in_well, self._event
        words[frame.WATCHDOG_FRAMES] = round(watchdog * 1e9 / frame.PERIOD)
        words[frame.SINGLE] = int(single)

    @property
    def waiting(self) -> int:
        """Reports that nobody has taken."""
        return (self.words[frame.HEAD] - self._taken) & 0xFFFFFFFF

    def take(self) -> bytes | None:
        """The next report; None where none waits."""
        waiting = self.waiting
        if waiting == 0:
            return None
        if waiting > frame.RING - 1:  # the oldest are overwritten
            self._taken += waiting - (frame.RING - 1)
        at = 4 * (frame.CONTROL + frame.REPORT * (self._taken % frame.RING))
        self._taken += 1
        return bytes(self._bytes[at : at + 4 * frame.REPORT])

    def give(self, report: bytes) -> None:
        """An output report, for the next period."""
        at = 4 * frame.OUTPUT
        self._bytes[at : at + OUTPUT.size] = report
        self._answers = (self._answers + 1) & 0x7FFFFFFF
        self.words[frame.ANSWER] = self._answers

    def sleep(self, timeout: float) -> None:
        """Until a frame is done, `timeout` s at most; the system waits in whole milliseconds."""
        self._poll.poll(max(1.0, 1e3 * timeout) if timeout > 0.0 else 0.0)
        with suppress(OSError):  # nothing there, or closed meanwhile
            os.eventfd_read(self._event)

    def end(self) -> None:
        """The servo thread has left."""
        event, self._event = self._event, -1
        if event >= 0:
            os.close(event)
