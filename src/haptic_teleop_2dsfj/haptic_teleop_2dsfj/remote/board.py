"""What the driver has in place of a board when that is in another computer: samples come as datagrams, and
what the board shall do goes as datagrams, each of which says all of it.

The server takes the current to zero by itself; that is never left to the client's last word.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable

import numpy as np

from haptic_teleop_2dsfj.board import READ_FORMAT, SERIAL_NUMBER, WRITE_FORMAT
from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.link_error import LinkError
from haptic_teleop_2dsfj.remote import datagrams as d
from haptic_teleop_2dsfj.remote.expiry import expiry_text
from haptic_teleop_2dsfj.remote.greeting import NO_SAMPLE, Greeting, agree, link_error, opened, server_name
from haptic_teleop_2dsfj.remote.link import ClientLink
from haptic_teleop_2dsfj.remote.round_trip import RoundTrips
from haptic_teleop_2dsfj.remote.sequence import Sequence
from haptic_teleop_2dsfj.remote.settings import RemoteSettings
from haptic_teleop_2dsfj.sample_clock import SampleClock
from haptic_teleop_control.clocks import Clock

FAREWELLS = 3
"""Of a client that leaves: one of them may get lost, and after all of them there is the watchdog."""


class RemoteBoard:
    """As `Board`. emulated: what kind of board the server must have. round_trips: of the datagrams, without
    the time that the server kept them."""

    def __init__(
        self,
        settings: BoardSettings,
        remote: RemoteSettings,
        link: ClientLink,
        key: bytes,
        clock: Clock,
        emulated: bool,
        on_read: Callable[[bytes], None] | None = None,
        on_write: Callable[[bytes], None] | None = None,
    ) -> None:
        self.settings, self._remote, self._link = settings, remote, link
        self._shared, self._clock, self._emulated = key, clock, emulated
        self._on_read, self._on_write = on_read, on_write
        self._sample_clock = SampleClock(settings.dt)
        self.counts = np.zeros(4, dtype=np.int32)
        self.sense_volts = np.zeros(2)
        self.switch_levels = np.ones(4, dtype=np.int8)
        self.periods = 1
        self.lag: float | None = None
        self.enabled = False
        self.sampling = self.board = self.expiry = ""
        self.round_trips = RoundTrips()
        self._key: bytes | None = None
        self._origin = [0, 0, 0, 0]
        self._watchdog = 0.0
        self._forget()

    @property
    def transport(self) -> str:
        return server_name(self._link)

    def measurements(self) -> dict[str, str]:
        """For diagnostics."""
        return {
            "transport": self.transport,
            "board": self.board or "not connected",
            "serial number": SERIAL_NUMBER,
            "round trip p50, p99, p99.9, largest (ms)": str(self.round_trips),
            "datagrams lost": str(self._incoming.lost),
        }

    def open(self) -> None:
        """Begins a session; counters are relative to its first sample. Raises LinkError."""
        self.close()
        self._forget()
        self._link.open()
        greeting = Greeting(self._link, self._remote.patience, self._clock)
        try:
            nonce = secrets.token_bytes(d.NONCE_BYTES)
            welcome = greeting.hello(nonce, self._emulated, self._shared)
            agree(welcome, self.settings, self._link)
            self._key = d.session_key(self._shared, nonce, welcome.offer)
            first = greeting.start(nonce, self._key)
            if self._incoming.take(first.sequence) is not None:
                raise link_error(self._link, NO_SAMPLE)
        except BaseException:
            self.close()
            raise
        self._watchdog = welcome.watchdog
        kind = "an emulated board" if welcome.emulated else "board"
        self.board = f"{kind} {welcome.card_type} {welcome.card_identifier}"
        self.sampling = f"from the {self.transport}, {self.board}"
        self._index, self._origin = first.passed - 1, list(first.counts)
        self._sample_clock.restart()
        self._accept(first)
        self._waiting = True

    def read(self) -> None:
        """Waits for the next sample and takes the newest. Raises LinkError when none comes, or something that
        is not the session's next datagram."""
        key, now, before = self._session(), self._clock.now(), self._stamp
        waiting, self._waiting = self._waiting, False
        until = now if waiting else now + round(self._remote.silence * 1e9)
        while (data := self._link.receive(until)) is not None:
            state = opened(data, key, self._link)
            if not isinstance(state, d.State):
                raise self._error(f"a datagram of it {d.Trouble.UNEXPECTED.value}")
            trouble = self._incoming.take(state.sequence)
            if trouble is not None:
                raise self._error(f"a datagram of it {trouble.value}")
            self._accept(state)
            until = self._clock.now()
        if self._stamp == before and not waiting:
            raise self._error(f"no sample for {self._remote.silence:g} s; check the cable and the server")
        self.periods, self._index = max(1, self._newest - self._index), self._newest
        self.lag = self._sample_clock.step(self._stamp, self.periods)
        if self._on_read is not None:
            packet = (*self.counts, *self.sense_volts, *self.switch_levels, self.periods, self._stamp)
            self._on_read(READ_FORMAT.pack(*packet))

    def write(self, first: float, second: float) -> None:
        self._volts = (first, second)
        self._send()
        self._wrote()

    def enable(self, on: bool) -> None:
        """On goes with the next `write`, off at once."""
        self._volts, self.enabled = (0.0, 0.0), on
        if not on:
            self._send()
        self._wrote()

    def reload_watchdog(self) -> bool:
        """False while the server has the amplifier off for a reason that `expiry` tells."""
        if not self._said:
            self._send()  # at rest nothing else tells it that its client lives
        self._said = False
        return not self.watchdog_expired()

    def watchdog_expired(self) -> bool:
        if not self._expired or self._rearmed != self._rearm:
            return False
        self.expiry = expiry_text(self._expired, self._watchdog)
        return True

    def rearm_watchdog(self) -> None:
        """Asked for with every datagram from now on, until the server says that it is done."""
        self._rearm += 1
        self.enable(False)

    def close(self) -> None:
        """Zero, amplifier off, session over; no errors."""
        key, self._key = self._key, None
        self.enabled, self._volts = False, (0.0, 0.0)
        if key is None:
            self._link.close()
            return
        try:
            for _ in range(FAREWELLS):
                self._link.send(d.pack(self._command(leaves=True), key))
        except LinkError:
            pass  # its watchdog knows
        self._link.close()
        self._wrote()

    # Inside.

    def _forget(self) -> None:
        self._incoming = Sequence()
        self._sent = self._stamp = self._arrived = self._index = self._newest = self._rearm = 0
        self._rearmed = self._expired = self._echo = 0
        self._volts, self._said, self.enabled = (0.0, 0.0), True, False
        self._waiting = False  # a sample that nobody has read: the session's first

    def _accept(self, state: d.State) -> None:
        self._arrived = self._clock.now()
        self._stamp, self._newest = state.stamp, state.passed
        self._rearmed, self._expired = state.rearmed, state.expired
        half = 1 << self.settings.counter_bits - 1
        for i, (count, origin) in enumerate(zip(state.counts, self._origin, strict=True)):
            self.counts[i] = (count - origin + half) % (2 * half) - half
        self.sense_volts[:], self.switch_levels[:] = state.senses, state.switches
        if state.echo != self._echo:
            self._echo = state.echo
            self.round_trips.add((self._arrived - state.echo - (state.sent - state.heard)) * 1e-9)

    def _send(self) -> None:
        self._link.send(d.pack(self._command(), self._session()))
        self._said = True

    def _command(self, leaves: bool = False) -> d.Command:
        self._sent += 1
        return d.Command(
            self._sent,
            self._clock.now(),
            self._stamp,
            self._arrived,
            self._rearm,
            self.enabled,
            leaves,
            *self._volts,
        )

    def _session(self) -> bytes:
        if self._key is None:
            raise self._error("there is no session")
        return self._key

    def _wrote(self) -> None:
        if self._on_write is not None:
            on = self.settings.enable_levels
            levels = on if self.enabled else tuple(1 - level for level in on)
            self._on_write(WRITE_FORMAT.pack(*self._volts, *levels))

    def _error(self, text: str) -> LinkError:
        return link_error(self._link, text)
