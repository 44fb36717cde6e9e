"""A process that ends with its exit status also where a library hangs while it is being closed."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

_CLOCK_MONOTONIC, _SIGEV_THREAD = 1, 2
_libc = ctypes.CDLL(None, use_errno=True)


class _SigEvent(ctypes.Structure):
    """sigevent(3type) of glibc."""

    _fields_ = (
        ("value", ctypes.c_long),
        ("signal", ctypes.c_int),
        ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("rest", ctypes.c_byte * 32),
    )


class _TimerSpec(ctypes.Structure):
    """itimerspec(3type): every, at; seconds and nanoseconds each."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("every", "every_ns", "at", "at_ns"))


@contextmanager
def ends_within(seconds: float, status: int) -> Iterator[None]:
    """Ends the process with ``status`` if the body has not ended after ``seconds``.

    For the end of a process that has done its work: Fast DDS (3.2) may wait for itself for good while
    publishers are destroyed, and does so holding the interpreter, so that no thread of Python could step in.
    A timer of the system calls `_exit` (timer_create(2), Linux).
    """
    sys.stdout.flush()
    sys.stderr.flush()
    leave = ctypes.cast(_libc._exit, ctypes.c_void_p).value
    event = _SigEvent(value=status, notify=_SIGEV_THREAD, function=leave)
    timer = ctypes.c_void_p()
    if _libc.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    whole = int(seconds)
    spec = _TimerSpec(at=whole, at_ns=round(1e9 * (seconds - whole)))
    try:
        _libc.timer_settime(timer, 0, ctypes.byref(spec), None)
        yield
    finally:
        _libc.timer_delete(timer)
