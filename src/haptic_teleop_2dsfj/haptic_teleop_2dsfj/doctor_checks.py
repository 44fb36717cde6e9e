"""What `doctor` looks at for the 2DSFJ: the manufacturer's package and library, or a board server."""

from __future__ import annotations

import ctypes.util
import importlib.util

from haptic_teleop_2dsfj.remote.probe import probe
from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.health import ABSENT, BAD, OK, Check


def checks() -> list[Check]:
    """The SDK; whether a board answers is only known by opening it, which the driver does."""
    if not _package():
        remedy = (
            "install the Quanser SDK and the quanser_api wheels of its python folder, or set device: emulated"
        )
        return [Check("Quanser SDK", ABSENT, "Python finds no quanser.hardware", remedy)]
    if ctypes.util.find_library("hil") is None:
        return [
            Check("Quanser SDK", BAD, "quanser.hardware without its library hil", "install the Quanser SDK")
        ]
    return [Check("Quanser SDK", OK, "quanser.hardware and its library hil")]


def board_checks(address: str, key_file: str) -> list[Check]:
    """Whether a board server answers at `address`, HOST or HOST:PORT, and what it has."""
    try:
        found = probe(address, key_file)
    except (DeviceError, ConfigurationError) as error:
        remedy = "see docs/board_server.md"
        return [Check("board server", BAD, str(error).rstrip("."), remedy)]
    kind = "an emulated board" if found.emulated else "a board"
    text = f"{kind} {found.card_type} {found.card_identifier} at {found.rate:g} Hz"
    text += ", in use by a driver" if found.busy else ", free"
    text += f"; current to zero after {found.watchdog:g} s without a command"
    return [Check("board server", OK, text)]


def _package() -> bool:
    try:
        return importlib.util.find_spec("quanser.hardware") is not None
    except (ImportError, OSError):  # another package of that name, or one that cannot be loaded
        return False
