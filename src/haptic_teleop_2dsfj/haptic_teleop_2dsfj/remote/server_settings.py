"""All settings of `sfj_board_server`, from the section of that name of a parameter file."""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from haptic_teleop_2dsfj.amplifier import Amplifier
from haptic_teleop_2dsfj.board_settings import BoardSettings
from haptic_teleop_2dsfj.local_board import EMULATED
from haptic_teleop_2dsfj.remote.link import PORT
from haptic_teleop_2dsfj.remote.settings import REMOTE
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameters import Parameter, ParameterTable
from haptic_teleop_control.quantities import check_quantities, from_parameters, parameters_of, quantity
from haptic_teleop_control.robots import SFJ_STAGES, STAGES

NODE = "sfj_board_server"
HIGHEST_VOLTS = tuple(SFJ_STAGES[stage].current_limit / Amplifier().a_per_v for stage in STAGES)


@dataclass(frozen=True)
class ServerSettings:
    """Raises ConfigurationError naming the field, also for a network that the key alone would guard."""

    board: BoardSettings = field(default_factory=BoardSettings)
    host: str = quantity("127.0.0.1", "", "address of this computer at which to listen")
    port: int = quantity(PORT, "", "UDP port; 0: any free one", minimum=0, maximum=65535)
    peer: str = quantity("127.0.0.1", "", "the only computer that may be a client")
    watchdog: float = quantity(
        0.02,
        "s",
        "time after the last command that answered a fresh sample (no older than this), after which the "
        "current goes to zero and the amplifier off",
        minimum=0.005,
        maximum=0.2,
    )
    answer_wait: float = quantity(
        0.0015, "s", "time to wait for the answer to a sample before the next one", minimum=0.0, maximum=0.1
    )
    highest_volts: tuple[float, ...] = quantity(
        HIGHEST_VOLTS,
        "V",
        "voltage of either output above which a command is refused: the motors' maximum current",
        minimum=0.0,
        maximum=10.0,
        length=2,
    )

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.board.card_type == REMOTE:
            raise ConfigurationError(
                "board.type is remote, which is for the driver; name the board that is here, for example q8."
            )
        here, there = address_of(self.host, "host"), address_of(self.peer, "peer")
        if there.is_unspecified or there.is_multicast or str(there) == "255.255.255.255":
            raise ConfigurationError(f"peer is {self.peer}, which is no single computer; name one.")
        if here.is_loopback != there.is_loopback:
            raise ConfigurationError(
                f"host is {self.host} and peer is {self.peer}: one is this computer's own and the other is "
                "not; set host to an address in the network of the driver, and peer to the driver's address."
            )
        if self.watchdog * self.board.rate < 2.0:
            raise ConfigurationError(
                f"watchdog is {self.watchdog:g} s, less than two samples at {self.board.rate:g} Hz; choose a "
                f"longer one, {2.0 / self.board.rate:g} s at least."
            )
        if self.answer_wait >= self.board.dt:
            raise ConfigurationError(
                f"answer_wait is {self.answer_wait:g} s, a period of {self.board.rate:g} Hz or more; the "
                f"next sample would be late: choose less than {self.board.dt:g} s."
            )

    @classmethod
    def from_parameters(cls, values: Mapping[str, Any], source: str = "parameters") -> ServerSettings:
        """From flat parameters, checked against TABLE. Raises ConfigurationError naming source and key."""
        checked = TABLE.check(values, source)
        try:
            return from_parameters(cls, checked, board=from_parameters(BoardSettings, checked))
        except ConfigurationError as error:
            raise ConfigurationError(f"{source}: {error}") from error


def address_of(name: str, key: str) -> ipaddress.IPv4Address:
    """The IPv4 address that `name` is or stands for. Raises ConfigurationError naming `key`."""
    try:
        return ipaddress.IPv4Address(name if name[:1].isdigit() else socket.gethostbyname(name))
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f"{key} is {name!r}, which stands for no IPv4 address; write one, such as 192.168.10.2."
        ) from error


def _table() -> ParameterTable:
    return ParameterTable(
        NODE,
        [
            Parameter(
                "device", "hardware", choices=("hardware", "emulated"), meaning="board, or emulated board"
            ),
            Parameter("key.file", "", meaning="the shared key; empty: that of this user, made where missing"),
            Parameter(
                "realtime_priority",
                0,
                minimum=0,
                maximum=90,
                meaning="SCHED_FIFO priority, where the system permits it; 0 for normal scheduling",
            ),
            *EMULATED,
            *parameters_of(ServerSettings(), runtime=False),
            *parameters_of(BoardSettings(), runtime=False),
        ],
    )


TABLE = _table()
"""Parameters of `sfj_board_server`."""
