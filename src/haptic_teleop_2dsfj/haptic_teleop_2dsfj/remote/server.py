"""The server's side of a session, without sockets, threads or waiting: `sample`, `take` and `watch` in turn.

It trusts nobody: the current is zero and the amplifier off unless the one client has answered a sample that
is as young as the watchdog. Whatever comes from the client's computer and is not the session's next datagram
ends the session, for neither loopback nor a cable between two computers duplicates, reorders or invents one.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote.expiry import Expiry, expiry_text
from haptic_teleop_2dsfj.remote.link import Address
from haptic_teleop_2dsfj.remote.server_settings import ServerSettings
from haptic_teleop_2dsfj.remote.session import Session
from haptic_teleop_control.clocks import Clock
from haptic_teleop_control.device import DeviceError

SESSION_SILENCE = 1.0
"""s without a word after which a client is no client any more."""


class BoardServer:
    """board: not yet open. send: takes a datagram and where it goes. peer: address of the client's computer.
    log: takes what an operator shall read. session: None while there is no client. strangers: datagrams from
    other computers; strays: those of the peer that belong to no session."""

    def __init__(
        self,
        board: Board,
        settings: ServerSettings,
        key: bytes,
        send: Callable[[bytes, Address], None],
        clock: Clock,
        emulated: bool,
        peer: str = "127.0.0.1",
        log: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.board, self.settings, self._key = board, settings, key
        self._send, self._clock, self._emulated, self._log, self._peer = send, clock, emulated, log, peer
        self._watchdog = round(settings.watchdog * 1e9)
        self.session: Session | None = None
        self._offer = secrets.token_bytes(d.NONCE_BYTES)
        self._over: tuple[Address, bytes, str] | None = None
        self._stamp = self._index = 0
        self.open = False
        self.strangers = self.strays = self.expiries = 0

    def open_board(self) -> None:
        """Outputs at 0 V, amplifier off. Raises ConfigurationError or DeviceError."""
        self.board.open()
        self.open = True

    def sample(self) -> None:
        """Waits for the board's next sample and sends it."""
        try:
            self.board.read()
            if not self.board.reload_watchdog():
                self._expire(Expiry.BOARD)
                self.board.rearm_watchdog()
        except DeviceError as error:
            self._fail(error)
            return
        self._stamp = self._clock.now()
        self._index += self.board.periods
        session = self.session
        if session is not None:
            state = session.state(self.board, self._stamp, self._index, self._clock.now())
            self._send(state, session.address)

    @property
    def awaits_answer(self) -> bool:
        """Whether the client has not yet answered the last sample."""
        return self.session is not None and self.session.answered != self._stamp

    def take(self, data: bytes, address: Address) -> None:
        """One datagram from anybody."""
        if address[0] != self._peer:
            self.strangers += 1
            return
        try:
            session = self.session
            if session is None or address != session.address:
                self._greet(data, address)
            elif not session.greeted(data, self._key):
                self._follow(data, session)
        except DeviceError as error:
            self._fail(error)

    def watch(self) -> None:
        """Looks at the time: the watchdog, and whether the client is still there."""
        session, now = self.session, self._clock.now()
        if session is None:
            return
        try:
            if self.board.enabled and now - session.fresh > self._watchdog:
                self._expire(Expiry.SILENCE)
        except DeviceError as error:
            self._fail(error)
            return
        if now - session.heard > SESSION_SILENCE * 1e9:
            self._end(f"the client was silent for {SESSION_SILENCE:g} s")

    def close(self) -> None:
        """Zero, amplifier off, board released; the client is told."""
        self._end("the board server has ended")
        self.board.close()
        self.open = False

    # The beginning of a session.

    def _greet(self, data: bytes, address: Address) -> None:
        """Something that is not from the address of the session."""
        found = self._opening(data)
        if isinstance(found, d.Probe):
            self._send(d.pack(self._welcome(found.nonce), self._key), address)
        elif self.session is not None:
            if isinstance(found, d.Hello):
                other = "{}:{}".format(*self.session.address)
                self._refuse(
                    address, self._key, f"another client, {other}, drives the board; end that one first"
                )
            self._hint(data, address, found)
            trouble = found if isinstance(found, d.Trouble) else d.Trouble.SECOND_CLIENT
            self._end(f"a datagram from {address[0]}:{address[1]} {trouble.value}")
        elif isinstance(found, d.Hello):
            self._answer(found, address)
        elif isinstance(found, d.Start):
            self._begin(found, address)
        else:
            self._stray(data, address, found)

    def _opening(self, data: bytes) -> d.Datagram | d.Trouble:
        """`data` with the keys that the beginning of a session has."""
        if d.kind_of(data) is d.Start:
            return d.unpack(data, d.session_key(self._key, d.unsigned_start(data).nonce, self._offer))
        found = d.unpack(data, self._key)
        return found if isinstance(found, (d.Hello, d.Probe, d.Trouble)) else d.Trouble.UNEXPECTED

    def _answer(self, hello: d.Hello, address: Address) -> None:
        if hello.emulated != self._emulated:
            has, wanted = ("an emulated", "hardware") if self._emulated else ("a real", "emulated")
            self._refuse(
                address,
                self._key,
                f"it has {has} board, and the driver's device is {wanted}; set device alike on both sides",
            )
            return
        if not self.open:
            try:
                self.open_board()
            except DeviceError as error:
                self._refuse(address, self._key, f"its board cannot be opened: {error}")
                return
            self._log("the board is open again")
        self._send(d.pack(self._welcome(hello.nonce), self._key), address)

    def _welcome(self, nonce: bytes) -> d.Welcome:
        board = self.settings.board
        return d.Welcome(
            nonce, self._offer, self._emulated, self.session is not None, board.rate, board.range_volts,
            board.output_bits, board.counter_bits, self.settings.watchdog,
            board.card_type, board.card_identifier,
        )  # fmt: skip

    def _begin(self, start: d.Start, address: Address) -> None:
        key, now = d.session_key(self._key, start.nonce, self._offer), self._clock.now()
        # Nothing that began with the last one can begin again.
        self._offer = secrets.token_bytes(d.NONCE_BYTES)
        self.board.rearm_watchdog()
        self.session = Session(key, start.nonce, address, now, now, self.settings.highest_volts)
        self._log(f"client {address[0]}:{address[1]} is here")

    def _stray(self, data: bytes, address: Address, found: d.Trouble | d.Datagram) -> None:
        self.strays += 1
        if self._over is not None and self._over[0] == address:
            _, key, text = self._over
            if text and not isinstance(d.unpack(data, key), d.Trouble):
                self._refuse(address, key, text)  # it has not heard it yet
        else:
            self._hint(data, address, found)

    def _hint(self, data: bytes, address: Address, found: d.Trouble | d.Datagram) -> None:
        """Who has another key cannot be told anything he could check, but why nothing comes."""
        if found is d.Trouble.KEY and d.kind_of(data) in (d.Hello, d.Probe):
            self._refuse(address, d.UNSIGNED, "")

    # A session.

    def _follow(self, data: bytes, session: Session) -> None:
        command = session.command(data, self._stamp)
        if isinstance(command, d.Trouble):
            self._end(f"a datagram {command.value}")
            return
        session.echo, session.answered = command.stamp, command.answers
        now = session.heard = self._clock.now()
        if command.leaves:
            self._end("")
            return
        if command.rearm != session.rearmed:
            self.board.rearm_watchdog()
            session.rearmed, session.expired = command.rearm, Expiry.NONE
        if not command.enable:
            if self.board.enabled:
                self.board.enable(False)
        elif session.expired is Expiry.NONE:
            age = now - command.answers
            if age > self._watchdog:
                kept = command.stamp - command.arrived
                self._log(f"an answer took {age * 1e-6:.1f} ms, {kept * 1e-6:.1f} of them in the driver")
                self._expire(Expiry.DELAY)
                return
            session.fresh = now
            if not self.board.enabled:
                self.board.enable(True)
            self.board.write(command.first, command.second)

    # Its end, and that of the current.

    def _expire(self, why: Expiry) -> None:
        """Zero and off, until the client asks for it anew."""
        driving = self.board.enabled
        if why is not Expiry.BOARD:  # which has gone to zero, and takes no output, until it is armed anew
            self.board.enable(False)
        if self.session is not None:
            self.session.expired = why
        if driving:
            self.expiries += 1
            self._log(f"current at zero, amplifier off: {expiry_text(why, self.settings.watchdog)}")

    def _end(self, why: str) -> None:
        """First the current, then the words. why: empty where the client has left by itself."""
        session, self.session = self.session, None
        if session is None:
            return
        lost: DeviceError | None = None
        try:
            self.board.enable(False)
        except DeviceError as error:
            lost = error
        if why:
            self._refuse(session.address, session.key, why)
        self._over = (session.address, session.key, why)
        self._log(f"the session is over, current at zero: {why or 'the client has left'}")
        if lost is not None:
            self._fail(lost)

    def _fail(self, error: DeviceError) -> None:
        """The board refused something: it is lost, unless its own watchdog took it to zero a moment ago."""
        try:
            if self.open and self.board.watchdog_expired():
                self._expire(Expiry.BOARD)
                self.board.rearm_watchdog()
                return
        except DeviceError as further:
            error = further
        self._lose(error)

    def _lose(self, error: DeviceError) -> None:
        """The board refused something or is gone: released, at zero, until the next client wants it."""
        self.board.close()
        self.open = False
        self._log(f"the board is lost: {error}")
        session, self.session = self.session, None
        if session is not None:
            text = f"the board failed at the server: {error}"
            self._refuse(session.address, session.key, text)
            self._over = (session.address, session.key, text)

    def _refuse(self, address: Address, key: bytes, text: str) -> None:
        self._send(d.pack(d.Refusal(key == d.UNSIGNED, text), key), address)
