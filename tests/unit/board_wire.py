"""A board server and a driver on one virtual clock, with a wire between that does to datagrams what a test
says.

Nothing waits and nothing is chance: the server's next sample is taken when the driver waits for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from device_rigs import UNSHAPED, Rig, StillRobot

from haptic_teleop_2dsfj.board import Board
from haptic_teleop_2dsfj.build import all_faults
from haptic_teleop_2dsfj.driver import SfjDriver
from haptic_teleop_2dsfj.emulated_hil import EmulatedHil
from haptic_teleop_2dsfj.remote.board import RemoteBoard
from haptic_teleop_2dsfj.remote.server import BoardServer
from haptic_teleop_2dsfj.remote.server_settings import ServerSettings
from haptic_teleop_2dsfj.remote.settings import RemoteSettings
from haptic_teleop_2dsfj.settings import SfjDriverSettings
from haptic_teleop_control.clocks import VirtualClock
from haptic_teleop_control.device import Reporter

KEY = bytes(range(32))
HERE = "127.0.0.1"


class OtherClock:
    """The clock of another computer: as good as `clock`, but it began at another time."""

    def __init__(self, clock: VirtualClock, ahead: int) -> None:
        self._clock, self._ahead = clock, ahead

    def now(self) -> int:
        return self._clock.now() + self._ahead

    def sleep_until(self, moment: int) -> None:
        self._clock.sleep_until(moment - self._ahead)


class Port:
    """The client's end, as `ClientLink`."""

    def __init__(self, wire: Wire, port: int) -> None:
        self.name, self._wire, self.address = f"{HERE}:28765", wire, (HERE, port)
        self.inbox: list[tuple[int, bytes]] = []

    def open(self) -> None:
        self.inbox.clear()

    def send(self, data: bytes) -> None:
        self._wire.to_server(data, self.address)

    def receive(self, until: int) -> bytes | None:
        wire = self._wire
        while True:
            if self.inbox and self.inbox[0][0] <= wire.clock.now():
                return self.inbox.pop(0)[1]
            if wire.client_clock.now() >= until:
                return None
            wire.step(until)

    def close(self) -> None:
        self.inbox.clear()


class Wire(Rig):
    """server: on an emulated board, `hil`, with `plant` behind it. delay: s, each way. up, down: what a
    datagram to the server, or to the client, becomes: none, one or several. parameters: of the driver, with
    __ for dots."""

    def __init__(
        self, plant: Any = None, delay: float = 0.0, server: dict[str, Any] | None = None, key: bytes = KEY,
        **parameters: Any,
    ) -> None:  # fmt: skip
        values = UNSHAPED | {name.replace("__", "."): value for name, value in parameters.items()}
        self.settings = SfjDriverSettings.from_parameters(values)
        self.clock = VirtualClock()
        self.client_clock = OtherClock(self.clock, 7_000_000_123_456)
        self.plant = StillRobot() if plant is None else plant
        self.hil = EmulatedHil(self.plant, self.settings.board, self.clock)
        board = Board(self.settings.board, lambda: self.hil, clock=self.clock)
        own = ServerSettings(board=self.settings.board, **(server or {}))
        self.log: list[str] = []
        self.server = BoardServer(
            board, own, KEY, self.to_client, self.clock, emulated=True, log=self.log.append
        )
        self.server.open_board()
        self.delay = round(delay * 1e9)
        self._way: list[tuple[int, bytes, tuple[str, int]]] = []
        self.ports: dict[int, Port] = {}
        self.up: Callable[[bytes], list[bytes]] = lambda data: [data]
        self.down: Callable[[bytes], list[bytes]] = lambda data: [data]
        self.sent: list[bytes] = []
        self.told: list[bytes] = []
        self.reporter, self.latch = Reporter.to_latch(all_faults())
        self.remote = self.client(40_000, key)
        self.driver = SfjDriver(self.settings, self.remote, self.reporter)

    def client(self, port: int, key: bytes = KEY, emulated: bool = True, **remote: Any) -> RemoteBoard:
        """Another client, in a program with a port of its own."""
        self.ports[port] = Port(self, port)
        return RemoteBoard(
            self.settings.board, RemoteSettings(**remote), self.ports[port], key, self.client_clock, emulated
        )

    def to_server(self, data: bytes, address: tuple[str, int] = (HERE, 40_000)) -> None:
        self.sent.append(data)
        for part in self.up(data):
            self._way.append((self.clock.now() + self.delay, part, address))
        self._deliver()

    def to_client(self, data: bytes, address: tuple[str, int]) -> None:
        self.told.append(data)
        for part in self.down(data):
            self.ports[address[1]].inbox.append((self.clock.now() + self.delay, part))

    def step(self, until: int | None = None) -> None:
        """The server's next sample and what belongs to it, as its loop does it."""
        self._deliver()
        if not self.server.open:
            self.clock.advance(0.01)
            self._deliver()
            return
        self.server.sample()
        self._deliver()
        self.server.watch()

    def _deliver(self) -> None:
        while self._way and self._way[0][0] <= self.clock.now():
            _, data, address = self._way.pop(0)
            self.server.take(data, address)

    def drive(self, effort: Any = (2.0, 0.4)) -> Wire:
        """The driver is open, and current flows."""
        self.driver.open()
        self.run(5, effort)
        assert any(self.plant.given[-1]), "it drives"
        return self

    def drives_after_a_reset(self, effort: Any) -> bool:
        self.reset()
        self.run(5, effort)
        return self.latch.latched is None and not self.off

    @property
    def off(self) -> bool:
        """No volts, and both stages disabled."""
        return not self.hil.volts.any() and not any(self.hil.amplifier_on)
