"""Real HID devices through hidapi (PyPI package `hidapi`, module `hid`), imported only when asked for.

Only the HID generation of the Touch can be reached in this way. The Phantom Omni of the thesis hangs on
FireWire, and the Touch with a serial or network port speaks another protocol: hidapi cannot open any of them.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

from haptic_teleop_control.device import DeviceError
from haptic_teleop_control.errors import ConfigurationError

_LARGEST = 4096
MODULES = ("hidraw", "hid")
"""hidapi's modules, the better one first: its wheels for Linux bring both, and there `hid` takes the whole
USB interface away from the kernel, while `hidraw` uses the kernel's own HID driver."""


class HidapiTransport:
    """A HID device by vendor and product number, and by serial number where there are several ("": any).

    numbered: whether its output reports carry a number; where not, hidapi wants a 0 in front. identity: both
    numbers and the serial number of the device that was opened, or its product's name where it has none.
    """

    name = "hid"
    emulated = False

    def __init__(self, vendor: int, product: int, serial: str = "", numbered: bool = False) -> None:
        self._vendor, self._product, self._serial, self._numbered = vendor, product, serial, numbered
        self._device: Any = None
        self.identity = self.serial = ""

    def open(self) -> None:
        """Raises ConfigurationError without the library, DeviceError when the device cannot be opened."""
        device = _library().device()
        try:
            device.open(self._vendor, self._product, self._serial or None)
            device.set_nonblocking(1)  # without a timeout `read` then returns at once
        except OSError as refusal:
            raise DeviceError(
                f"no HID device {self._vendor:04x}:{self._product:04x} can be opened ({refusal}); hidapi "
                "reaches only the Touch with USB HID; transport: openhaptics reaches the others, such as the "
                "thesis' Phantom Omni on FireWire"
            ) from refusal
        self._device = device
        self.serial = _text(device.get_serial_number_string)
        own = self.serial or _text(device.get_product_string)
        self.identity = f"{self._vendor:04x}:{self._product:04x}" + (f":{own}" if own else "")

    def read(self, timeout: float) -> bytes | None:
        """See OmniTransport; hidapi waits in whole milliseconds."""
        device = self._opened()
        try:
            if timeout > 0.0:
                return bytes(device.read(_LARGEST, max(1, round(timeout * 1e3)))) or None
            return bytes(device.read(_LARGEST)) or None
        except (OSError, ValueError) as failure:
            raise DeviceError(f"reading the HID device failed ({failure})") from failure

    def write(self, report: bytes) -> None:
        device = self._opened()
        try:
            written = device.write(report if self._numbered else b"\x00" + report)
        except (OSError, ValueError) as failure:
            raise DeviceError(f"writing to the HID device failed ({failure})") from failure
        if written < 0:
            raise DeviceError(f"writing to the HID device failed ({device.error()})")

    def close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            device.close()

    def describe(self) -> str:
        return f"HID device {self._vendor:04x}:{self._product:04x}"

    def _opened(self) -> Any:
        if self._device is None:
            raise DeviceError("the HID device is not open")
        return self._device


def _text(ask: Callable[[], str | None]) -> str:
    try:
        return " ".join((ask() or "").split())
    except (OSError, ValueError):  # a device need not have it
        return ""


def _library() -> Any:
    for name in MODULES:
        try:
            return importlib.import_module(name)
        except ImportError:
            continue
    raise ConfigurationError(
        "device is hardware, but Python finds no module hid; run `pip install hidapi`, or set "
        "device: emulated."
    )
