"""A process that ends with its exit status also where a library hangs while it is being closed."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_CLOCK_MONOTONIC, _SIGEV_THREAD = 1, 2


def _timers() -> ctypes.CDLL | None:
    """The library that has the system's timers: glibc, before 2.34 its librt; None where neither has."""
    for name in (None, "librt.so.1"):
        with suppress(OSError):
            library = ctypes.CDLL(name)
            if hasattr(library, "timer_create"):
                return library
    return None


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
    A timer of the system calls `_exit` (timer_create(2), Linux); where there is none to be had, the
    body runs without.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # a reader that has gone, or a stream that is closed
            stream.flush()
    timers = _timers()
    timer = None if timers is None else _start(timers, seconds, status)
    try:
        yield
    finally:
        if timers is not None and timer is not None:
            timers.timer_delete(timer)


def _start(timers: ctypes.CDLL, seconds: float, status: int) -> ctypes.c_void_p | None:
    """The running timer, or None where the system has none left."""
    leave = ctypes.cast(ctypes.CDLL(None)._exit, ctypes.c_void_p).value
    event = _SigEvent(value=status, notify=_SIGEV_THREAD, function=leave)
    timer = ctypes.c_void_p()
    if timers.timer_create(_CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        return None
    whole = int(seconds)
    spec = _TimerSpec(at=whole, at_ns=round(1e9 * (seconds - whole)))
    timers.timer_settime(timer, 0, ctypes.byref(spec), None)
    return timer
