"""What `doctor` looks at for the 2DSFJ: the manufacturer's Python package and its library."""

from __future__ import annotations

import ctypes.util
import importlib.util

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


def _package() -> bool:
    try:
        return importlib.util.find_spec("quanser.hardware") is not None
    except (ImportError, OSError):  # another package of that name, or one that cannot be loaded
        return False
