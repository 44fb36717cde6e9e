"""The server's side towards whoever has no session: questions answered, a new client let in, everything else
refused, in words where he can check them."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from typing import NamedTuple

from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote.link import Address
from haptic_teleop_2dsfj.remote.server_settings import ServerSettings


class Entry(NamedTuple):
    """A client who has proved that he knows the key: that of his session, and the nonce of his greeting."""

    key: bytes
    nonce: bytes


class Reception:
    """emulated: what kind of board is here. send: takes a datagram and where it goes. ready: opens the board
    where it is not open, and says why it cannot, else ""."""

    def __init__(
        self,
        settings: ServerSettings,
        key: bytes,
        emulated: bool,
        send: Callable[[bytes, Address], None],
        ready: Callable[[], str],
    ) -> None:
        self.emulated = emulated
        self._settings, self._key, self._send, self._ready = settings, key, send, ready
        self._offer = secrets.token_bytes(d.NONCE_BYTES)
        self._over: tuple[Address, bytes, str] | None = None

    def arrive(self, data: bytes, address: Address) -> Entry | None:
        """A datagram while nobody drives; what it takes to begin a session, where it does."""
        found = self._opening(data)
        if isinstance(found, d.Probe):
            self._welcome(found.nonce, address, busy=False)
        elif isinstance(found, d.Hello):
            self._answer(found, address)
        elif isinstance(found, d.Start):
            key = d.session_key(self._key, found.nonce, self._offer)
            # Nothing that began with the last one can begin again.
            self._offer = secrets.token_bytes(d.NONCE_BYTES)
            return Entry(key, found.nonce)
        else:
            self._stray(data, address, found)
        return None

    def disturb(self, data: bytes, address: Address, driving: Address) -> str:
        """A datagram from elsewhere while the client at `driving` drives; why that ends his session, "" where
        it does not."""
        found = self._opening(data)
        if isinstance(found, d.Probe):
            self._welcome(found.nonce, address, busy=True)
            return ""
        if isinstance(found, d.Hello):
            other = "{}:{}".format(*driving)
            self.refuse(address, self._key, f"another client, {other}, drives the board; end that one first")
        self._hint(data, address, found)
        trouble = found if isinstance(found, d.Trouble) else d.Trouble.SECOND_CLIENT
        return f"a datagram from {address[0]}:{address[1]} {trouble.value}"

    def part(self, address: Address, key: bytes, why: str) -> None:
        """The session of `address` is over; why: "" where he has left by himself."""
        if why:
            self.refuse(address, key, why)
        self._over = (address, key, why)

    def refuse(self, address: Address, key: bytes, text: str) -> None:
        self._send(d.pack(d.Refusal(key == d.UNSIGNED, text), key), address)

    def _opening(self, data: bytes) -> d.Datagram | d.Trouble:
        """`data` with the keys that the beginning of a session has."""
        if d.kind_of(data) is d.Start:
            return d.unpack(data, d.session_key(self._key, d.unsigned_start(data).nonce, self._offer))
        found = d.unpack(data, self._key)
        return found if isinstance(found, (d.Hello, d.Probe, d.Trouble)) else d.Trouble.UNEXPECTED

    def _answer(self, hello: d.Hello, address: Address) -> None:
        if hello.emulated != self.emulated:
            has, wanted = ("an emulated", "hardware") if self.emulated else ("a real", "emulated")
            text = f"it has {has} board, and the driver's device is {wanted}; set device alike on both sides"
        else:
            text = self._ready()
        if text:
            self.refuse(address, self._key, text)
            return
        self._welcome(hello.nonce, address, busy=False)

    def _welcome(self, nonce: bytes, address: Address, busy: bool) -> None:
        board = self._settings.board
        welcome = d.Welcome(
            nonce, self._offer, self.emulated, busy, board.rate, board.range_volts, board.output_bits,
            board.counter_bits, self._settings.watchdog, board.card_type, board.card_identifier,
        )  # fmt: skip
        self._send(d.pack(welcome, self._key), address)

    def _stray(self, data: bytes, address: Address, found: d.Trouble | d.Datagram) -> None:
        if self._over is not None and self._over[0] == address:
            _, key, text = self._over
            if text and not isinstance(d.unpack(data, key), d.Trouble):
                self.refuse(address, key, text)  # it has not heard it yet
        else:
            self._hint(data, address, found)

    def _hint(self, data: bytes, address: Address, found: d.Trouble | d.Datagram) -> None:
        """Who has another key cannot be told anything he could check, but why nothing comes."""
        if found is d.Trouble.KEY and d.kind_of(data) in (d.Hello, d.Probe):
            self.refuse(address, d.UNSIGNED, "")
