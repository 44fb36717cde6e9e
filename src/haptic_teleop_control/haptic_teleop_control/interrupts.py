"""A Ctrl-C that Python has to swallow is raised anew.

Where an exception has nowhere to go (a callback of a compiled library, a destructor), Python prints that it
was ignored and goes on. Of a Ctrl-C that is what the user least wants: numba's compiler calls Python back for
every function it compiles or loads, and a run that was interrupted there went on to its end.
"""

from __future__ import annotations

import _thread
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

_AFTER = 1e-3
"""s after which it is raised anew: when what swallowed it has returned."""


@contextmanager
def nothing_swallowed() -> Iterator[None]:
    """Within it an interrupt that Python ignored comes again, a moment later."""
    before = sys.unraisablehook

    def hook(ignored: sys.UnraisableHookArgs, /) -> None:
        if issubclass(ignored.exc_type, KeyboardInterrupt):
            _thread.start_new_thread(_again, ())
        else:
            before(ignored)

    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = before


def _again() -> None:
    time.sleep(_AFTER)
    _thread.interrupt_main()
