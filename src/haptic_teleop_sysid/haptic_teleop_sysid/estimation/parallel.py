"""Independent fits side by side: threads, because compiled code releases the interpreter's lock.

What is fitted side by side shares nothing, and results come in the order of what was asked for, so that they
are the same whatever the number of threads.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.kernel.build import kernel

VARIABLE = "HAPTIC_TELEOP_THREADS"
_Given = TypeVar("_Given")
_Found = TypeVar("_Found")
_state = threading.local()

#: Bytes that fits may take at once, and that one takes per sample of a recording (measured).
_ROOM, _PER_SAMPLE = 1_000_000_000, 1500


def thread_count() -> int:
    """Threads for independent fits: the cores that this process may use, or as many as ``VARIABLE`` says."""
    chosen = os.environ.get(VARIABLE, "").strip()
    if not chosen:
        return len(os.sched_getaffinity(0))
    if not chosen.isdigit() or int(chosen) < 1:
        raise ConfigurationError(f"{VARIABLE} is {chosen!r}: give a number of threads from 1 on.")
    return int(chosen)


def at_most() -> int:
    """Fits that may run at once: `thread_count`, or as many as there is memory for (see `within_memory`)."""
    return min(thread_count(), getattr(_state, "most", None) or thread_count())


@contextmanager
def within_memory(samples: int) -> Iterator[None]:
    """Begin no more threads at once than there is room for, one at least, where the longest recording has
    that many ``samples``; holds for the calling thread."""
    before = getattr(_state, "most", None)
    _state.most = max(1, _ROOM // (_PER_SAMPLE * max(samples, 1)))
    try:
        yield
    finally:
        _state.most = before


def side_by_side(work: Callable[[_Given], _Found], given: Iterable[_Given]) -> list[_Found]:
    """``work`` of every item, in their order; on `at_most` threads, and on the calling one alone where
    that is one of these already. The first error, in the order of the items, is raised."""
    items = list(given)
    count = min(at_most(), len(items))
    if count < 2 or getattr(_state, "busy", False):
        return [work(item) for item in items]
    kernel()  # compiled or loaded before there are threads: it is kept in a folder of files

    def alone(item: _Given) -> _Found:
        _state.busy = True
        return work(item)

    pool = ThreadPoolExecutor(count)
    try:
        return list(pool.map(alone, items))
    finally:
        # After an error or an interrupt nothing more is begun.
        pool.shutdown(wait=True, cancel_futures=True)


def by_itself(work: Callable[..., _Found], *given: object) -> _Found:
    """``work`` of what is given, all of it on the calling thread: for processes that are one of many."""
    before, _state.busy = getattr(_state, "busy", False), True
    try:
        return work(*given)
    finally:
        _state.busy = before
