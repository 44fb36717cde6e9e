"""What a transport is: whole reports in and out, and nothing about what is in them."""

from __future__ import annotations

from typing import Protocol


class OmniTransport(Protocol):
    """name: for diagnostics. emulated: whether nobody's hand is at the other end. identity: which device it
    is, once it is open; "" for none that could be mistaken; serial: the number in it. Every call but `close`
    may raise DeviceError."""

    name: str
    emulated: bool
    identity: str
    serial: str

    def open(self) -> None: ...

    def read(self, timeout: float) -> bytes | None:
        """The next report, waited for up to `timeout` s (0: only what is there); None when there is none.
        Raises EndOfSession when a replayed session is over."""
        ...

    def write(self, report: bytes) -> None: ...

    def close(self) -> None:
        """Releases the device; may be called more than once and raises nothing."""

    def describe(self) -> str: ...
