"""The server's side of a session, without sockets, threads or waiting: `sample`, `take` and `watch` in turn.

It trusts nobody: the current is zero and the amplifier off unless the one client has answered a sample that
is as young as the watchdog. Whatever comes from the client's computer and is not the session's next datagram
ends the session, for neither loopback nor a cable between two computers duplicates, reorders or invents one.
"""

from __future__ import annotations

from collections.abc import Callable

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote.expiry import Expiry, expiry_text
from haptic_teleop_2dsfj.remote.link import Address
from haptic_teleop_2dsfj.remote.reception import Reception
from haptic_teleop_2dsfj.remote.server_settings import ServerSettings
from haptic_teleop_2dsfj.remote.session import Session
from haptic_teleop_control.clocks import Clock
from haptic_teleop_control.device import DeviceError

SESSION_SILENCE = 1.0
"""s without a word after which a client is no client any more."""


class BoardServer:
    """board: not yet open. send: takes a datagram and where it goes. peer: address of the client's computer.
    log: takes what an operator shall read. session: None while there is no client. strangers: datagrams from
    other computers. reception: for those of the peer that belong to no session."""

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
        self._send, self._clock, self._log, self._peer = send, clock, log, peer
        self._watchdog = round(settings.watchdog * 1e9)
        self.session: Session | None = None
        self.reception = Reception(settings, key, emulated, send, self._ready)
        self._stamp = self._index = 0
        self.open = False
        self.strangers = self.expiries = 0

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
            if session is None:
                self._begin(data, address)
            elif address != session.address:
                why = self.reception.disturb(data, address, session.address)
                if why:
                    self._end(why)
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

    # A session.

    def _ready(self) -> str:
        """Opens the board where it was lost; why that cannot be, else ""."""
        if not self.open:
            try:
                self.open_board()
            except DeviceError as error:
                return f"its board cannot be opened: {error}"
            self._log("the board is open again")
        return ""

    def _begin(self, data: bytes, address: Address) -> None:
        entry = self.reception.arrive(data, address)
        if entry is None:
            return
        now = self._clock.now()
        self.board.rearm_watchdog()
        self.session = Session(entry.key, entry.nonce, address, now, now, self.settings.highest_volts)
        self._log(f"client {address[0]}:{address[1]} is here")

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
        self.reception.part(session.address, session.key, why)
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
            self.reception.part(session.address, session.key, f"the board failed at the server: {error}")
