"""Opening a device of the HD library: by which name, with which serial number, and with the force off."""

from __future__ import annotations

import ctypes
from ctypes import c_int
from typing import NamedTuple

from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_omni.transports import hd_library as hd

_NOT_CONFIGURED = 0x0303


class HdDevice(NamedTuple):
    """identity: model and serial number, with a colon between. style: of calibration, to be asked for."""

    handle: int
    identity: str
    serial: str
    version: str
    style: int


def open_device(library: hd.HdLibrary, name: str, serial: str) -> HdDevice:
    """The device `name` ("": the names that set-up tools give), its force off. serial: that it must have; "":
    any.

    Raises ConfigurationError for another serial number, DeviceError with what helps when it cannot be opened.
    """
    library.error()
    refusals = []
    for known in (name,) if name else hd.DEVICE_NAMES:
        handle = int(library.hdInitDevice(known.encode()))
        try:
            library.check(f"{known!r} cannot be opened")
            if handle == hd.BAD_HANDLE:
                raise DeviceError(f"{known!r} cannot be opened: the library says no reason")
        except DeviceError as refusal:
            refusals.append(refusal)
            continue
        return _examine(library, handle, serial)
    # Of two names the wrong one is merely not configured: the graver reason is the device's.
    raise max(refusals, key=lambda refusal: (refusal.code != _NOT_CONFIGURED, refusal.code))


def _examine(library: hd.HdLibrary, handle: int, wanted: str) -> HdDevice:
    library.hdMakeCurrentDevice(handle)
    library.hdDisable(hd.FORCE_OUTPUT)
    serial = library.text(hd.SERIAL)
    identity = ":".join(part for part in (library.text(hd.MODEL), serial) if part)
    version = library.text(hd.DRIVER_VERSION)
    if wanted not in ("", serial):
        library.hdDisableDevice(handle)
        raise ConfigurationError(
            f"openhaptics.serial is {wanted!r}, but the device that was opened has {serial!r}; name the "
            "other one with openhaptics.device_name, or correct the number."
        )
    styles = c_int(0)
    library.hdGetIntegerv(hd.CALIBRATION_STYLE, ctypes.byref(styles))
    library.error()
    style = next((style for style, _ in hd.STYLES if styles.value & style), hd.INKWELL)
    return HdDevice(handle, identity, serial, version, style)
