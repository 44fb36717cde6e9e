"""Ctrl-C and SIGTERM as a request: what is under way is finished first."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
#: Time after which a signal is told again where the first telling was lost, s.
AGAIN = 0.01


class StopRequests:
    """Whether SIGINT or SIGTERM has come; nothing is interrupted, so that no message is half sent.

    No `threading.Event`: a second signal comes while the handler of the first holds its lock, and that
    process never ends.
    """

    class Interrupt(BaseException):
        """A signal in a block of `interruptible`."""

    def __init__(self) -> None:
        self._requested = False
        self._interrupts = False

    def is_set(self) -> bool:
        return self._requested

    def take(self, *_: object) -> None:
        self._requested = True
        if self._interrupts:
            raise self.Interrupt

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """Within this block a signal also ends what is under way, such as a compilation of ten seconds;
        nothing moves yet. One that was there before ends it at once.

        Python drops what is raised in a callback of a weak reference or in `__del__`, and prints it: there
        the signal is told again when that is over.
        """
        if self.is_set():
            raise self.Interrupt
        others, alarm = sys.unraisablehook, signal.signal(signal.SIGALRM, self.take)

        def dropped(what: sys.UnraisableHookArgs) -> None:
            if what.exc_type is self.Interrupt:
                signal.setitimer(signal.ITIMER_REAL, AGAIN)
            else:
                others(what)

        try:
            sys.unraisablehook = dropped
            self._interrupts = True
            yield
        finally:
            self._interrupts = False
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            sys.unraisablehook = others
            signal.signal(signal.SIGALRM, alarm)


@contextmanager
def stop_requests() -> Iterator[StopRequests]:
    """`StopRequests` as long as the block lasts."""
    stop = StopRequests()
    previous = {number: signal.signal(number, stop.take) for number in STOP_SIGNALS}
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)
    try:
        yield stop
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
