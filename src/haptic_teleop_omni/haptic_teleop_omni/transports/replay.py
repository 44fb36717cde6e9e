"""The transport of a captured session: the reports that came then, at the same pace."""

from __future__ import annotations

from haptic_teleop_control.clocks import Clock
from haptic_teleop_control.replay import Session


class ReplayTransport:
    """What is written goes nowhere."""

    name = "replay"
    emulated = True
    identity = serial = ""

    def __init__(self, session: Session, clock: Clock) -> None:
        self._session, self._clock = session, clock
        self._origin: int | None = None

    def open(self) -> None: ...

    def read(self, timeout: float) -> bytes | None:
        """See OmniTransport."""
        report = self._session.next_read()
        if report is not None:
            if self._origin is None:
                self._origin = self._clock.now() - self._session.first_stamp
            self._clock.sleep_until(self._origin + self._session.last_stamp)
        return report

    def write(self, report: bytes) -> None: ...

    def close(self) -> None: ...

    def describe(self) -> str:
        return "captured session"
