"""Readers that a damaged file can crash, in a process of their own: then that file is lost, and no other."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from multiprocessing import get_context
from pathlib import Path

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.logs.log import Log


def read_isolated(reader: Callable[[Path], Log], path: Path) -> Log:
    """Return what ``reader``, a function of a module, makes of a file; its errors are raised here, and a
    RecordingError where its process died. The process is started once and serves the files that follow."""
    try:
        return _process().submit(reader, path).result()
    except BrokenProcessPool as error:
        _process.cache_clear()
        raise RecordingError(
            f"{path} is damaged so that reading it fails altogether: write it again, or export it as CSV."
        ) from error


@cache
def _process() -> ProcessPoolExecutor:
    # Not forked: threads of this process may hold locks.
    return ProcessPoolExecutor(1, get_context("spawn"))
