"""The vendor's HD library (OpenHaptics) by ctypes: where it is, its calls with their exact types, its
errors."""

from __future__ import annotations

import ctypes
import ctypes.util
from ctypes import c_char_p, c_int, c_uint, c_ulong, c_ushort, c_void_p
from pathlib import Path
from typing import Any

from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_omni.device_errors import device_problem

BAD_HANDLE = 0xFFFFFFFF
FORCE_OUTPUT = 0x4000
CURRENT_BUTTONS, INKWELL_SWITCH = 0x2000, 0x2002
JOINT_ANGLES, GIMBAL_ANGLES, JOINT_TORQUE = 0x2100, 0x2150, 0x2703
MODEL, DRIVER_VERSION, SERIAL, CALIBRATION_STYLE, MOTOR_TEMPERATURE = 0x2501, 0x2502, 0x2504, 0x2555, 0x2605
CALIBRATION_OK, CALIBRATION_NEEDS_UPDATE = 0x5000, 0x5001
STYLES = ((2, "automatic"), (4, "inkwell"), (1, "encoder reset"))
"""Of calibration, the preferred one first: one of them is asked for, never several at once."""

INKWELL = 4
CALLBACK = ctypes.CFUNCTYPE(c_uint, c_void_p)
DEVICE_NAMES = ("Default Device", "Default PHANToM")
"""What set-up tools call the first device, newer ones first. NULL, the documented default, is not tried:
users report that it fails on FireWire installations."""


class ErrorInfo(ctypes.Structure):
    """What hdGetError returns, by value."""

    _fields_ = (("code", c_uint), ("internal", c_int), ("device", c_uint))


SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "hdInitDevice": (c_uint, [c_char_p]),
    "hdDisableDevice": (None, [c_uint]),
    "hdMakeCurrentDevice": (None, [c_uint]),
    "hdBeginFrame": (None, [c_uint]),
    "hdEndFrame": (None, [c_uint]),
    "hdEnable": (None, [c_uint]),
    "hdDisable": (None, [c_uint]),
    "hdGetDoublev": (None, [c_uint, c_void_p]),
    "hdGetIntegerv": (None, [c_uint, c_void_p]),
    "hdGetBooleanv": (None, [c_uint, c_void_p]),
    "hdSetDoublev": (None, [c_uint, c_void_p]),
    "hdGetString": (c_char_p, [c_uint]),
    "hdGetError": (ErrorInfo, []),
    "hdCheckCalibration": (c_uint, []),
    "hdUpdateCalibration": (None, [c_uint]),
    "hdStartScheduler": (None, []),
    "hdStopScheduler": (None, []),
    "hdScheduleAsynchronous": (c_ulong, [CALLBACK, c_void_p, c_ushort]),
    "hdScheduleSynchronous": (None, [CALLBACK, c_void_p, c_ushort]),
    "hdUnschedule": (None, [c_ulong]),
}


class HdLibrary:
    """The calls as attributes (`hd.hdInitDevice(...)`). opened: what this process drives through it, each
    with `restarted()`."""

    def __init__(self, path: str, library: ctypes.CDLL) -> None:
        self.path, self.library = path, library
        self.opened: list[Any] = []
        for name, (result, arguments) in SIGNATURES.items():
            try:
                call = getattr(library, name)
            except AttributeError:
                raise ConfigurationError(
                    f"{path} has no {name}: it is no HD library, or an older one than 3.0; install the "
                    "vendor's OpenHaptics for your device, or name its file with openhaptics.library."
                ) from None
            call.restype, call.argtypes = result, arguments

    def __getattr__(self, name: str) -> Any:
        return getattr(self.library, name)

    def stop_scheduler(self) -> None:
        """Stops the servo thread, which holds the last torque while it stands: so nobody has one by then."""
        for device in self.opened:
            device.pause()
        self.library.hdStopScheduler()
        for device in self.opened:
            device.paused()

    def start_scheduler(self) -> None:
        """Starts the servo thread, whose first frames may be errors for whoever has a device."""
        for device in self.opened:
            device.restarted()
        self.library.hdStartScheduler()

    def error(self) -> tuple[int, int]:
        """The gravest error since the last look and the library's further code; (0, 0) for none."""
        gravest = (0, 0)
        for _ in range(64):
            found = self.library.hdGetError()
            if found.code == 0:
                break
            gravest = max(gravest, (found.code, found.internal))
        return gravest

    def check(self, what: str) -> None:
        """Raises DeviceError with the remedy where the last calls have failed."""
        code, internal = self.error()
        if code:
            raise DeviceError(f"{what}: {device_problem(code, internal).text}", code)

    def text(self, parameter: int) -> str:
        """A text of the current device on one line; "" where it has none."""
        found = self.library.hdGetString(parameter)
        self.error()
        return " ".join((found or b"").decode("utf-8", "replace").split())


_loaded: dict[str, HdLibrary] = {}


def load_library(stated: str = "") -> HdLibrary:
    """The library `stated`, an absolute path or a bare name that the system's loader knows; "": libHD.so.

    Raises ConfigurationError naming the remedy.
    """
    if "/" in stated and not Path(stated).is_absolute():
        raise ConfigurationError(
            f"openhaptics.library is {stated!r}; write an absolute path, or a bare name that the system's "
            "loader finds."
        )
    path = stated or ctypes.util.find_library("HD") or "libHD.so"
    if path not in _loaded:
        try:
            library = ctypes.CDLL(path)
        except OSError as refusal:
            raise ConfigurationError(
                f"transport is openhaptics, but {path} cannot be loaded ({refusal}); install the vendor's "
                "OpenHaptics and device driver (docs/drivers.md), or name the file with openhaptics.library."
            ) from refusal
        _loaded[path] = HdLibrary(path, library)
    return _loaded[path]
