"""Where compiled kernels are kept: a folder of the user's own; where it cannot be trusted, a private one."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from functools import lru_cache
from pathlib import Path

import platformdirs

from haptic_teleop_control.private_folder import prepare_private

VARIABLE = "HAPTIC_TELEOP_CACHE"


def cache_directory() -> Path:
    """Where kernels are kept: ``HAPTIC_TELEOP_CACHE``, or in the user's cache directory.

    It is made (mode 0700) where it is missing. One that others can write into, that belongs to somebody else
    or that cannot be made is not used: a warning says so, and a private one takes its place, for this process
    and those that it starts, removed at the end.
    """
    chosen = os.environ.get(VARIABLE)
    return _usable(Path(chosen) if chosen else Path(platformdirs.user_cache_dir("haptic_teleop")) / "kernels")


@lru_cache
def _usable(folder: Path) -> Path:
    problem = prepare_private(folder)
    if problem is None:
        return folder
    private = Path(tempfile.mkdtemp(prefix="haptic_teleop_kernels_"))  # mode 0700
    atexit.register(_remove, private, os.getpid())
    os.environ[VARIABLE] = str(private)  # for the processes that this one starts
    print(
        f"haptic-teleop: warning: {problem}: compiled code is not loaded from there, but compiled anew for "
        f"this run alone; remove that folder, or name one of your own in {VARIABLE}",
        file=sys.stderr,
        flush=True,
    )
    return private


def _remove(folder: Path, process: int) -> None:
    if os.getpid() == process:  # not in a child that was forked
        shutil.rmtree(folder, ignore_errors=True)
