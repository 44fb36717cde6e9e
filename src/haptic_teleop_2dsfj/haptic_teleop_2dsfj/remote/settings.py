"""Where the board server is, as parameters of the driver."""

from __future__ import annotations

from dataclasses import dataclass

from haptic_teleop_2dsfj.remote.link import PORT
from haptic_teleop_control.quantities import check_quantities, quantity

REMOTE = "remote"
"""As `board.type`: the board is another computer's, that of `remote.host`."""


@dataclass(frozen=True)
class RemoteSettings:
    """Raises ConfigurationError naming the field for a value outside its range."""

    host: str = quantity("127.0.0.1", "", "address of the computer that runs sfj_board_server")
    port: int = quantity(PORT, "", "its UDP port", minimum=1, maximum=65535)
    key_file: str = quantity("", "", "the shared key; empty: that of this user", name="key.file")
    silence: float = quantity(
        0.1, "s", "time without a sample after which the board is lost", minimum=0.02, maximum=0.4
    )
    patience: float = quantity(
        3.0, "s", "time that the server may take to answer at the start", minimum=0.1, maximum=9.0
    )

    def __post_init__(self) -> None:
        check_quantities(self)
