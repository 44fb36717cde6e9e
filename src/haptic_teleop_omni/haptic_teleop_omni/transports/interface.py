"""What a transport is: whole reports in and out, and nothing about what is in them."""

from __future__ import annotations

from typing import Protocol


class OmniTransport(Protocol):
    """emulated: whether nobody's hand is at the other end. identity: which device it is, once it is open; ""
    for none that could be mistaken. Every call but `close` may raise DeviceError."""

    emulated: bool
    identity: str

    def open(self) -> None: ...

    def read(self, timeout: float) -> bytes | None:
        """The next report, waited for up to `timeout` s (0: only what is there); None when there is none.
        Raises EndOfSession when a replayed session is over."""
        ...

    def write(self, report: bytes) -> None: ...

    def close(self) -> None:
        """Releases the device; may be called more than once and raises nothing."""

    def describe(self) -> str: ...
