"""A child process that does not outlive its parent, however the parent ends."""

from __future__ import annotations

import ctypes
import os
import signal
from collections.abc import Callable

_PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


def ends_with_parent(blocked: tuple[signal.Signals, ...] = ()) -> Callable[[], None]:
    """For `preexec_fn` of a child that this process is about to start: the system sends it SIGTERM when the
    thread that started it ends (Linux, prctl(2)). ``blocked``: signals that wait until the child unblocks
    them."""
    parent = os.getpid()

    def prepare() -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
        _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # it died before the line above
            os._exit(1)

    return prepare
