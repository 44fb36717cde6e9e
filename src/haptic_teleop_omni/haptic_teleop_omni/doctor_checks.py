"""What `doctor` looks at for the Omni: hidapi, the device by its kind of link, permissions, layout."""

from __future__ import annotations

import importlib.resources
import importlib.util
import os
from pathlib import Path

from haptic_teleop_control.health import ABSENT, BAD, OK, Check
from haptic_teleop_omni.transports.hidapi import MODULES

RULE = "60-haptic-teleop.rules"
HID_NUMBERS = "00002988:00000304"
USB_SERIAL = ("2988", "0302")
FIREWIRE_VENDOR = "0x000b99"


def udev_rule() -> str:
    """The rules file that lets the logged-in user open the device."""
    return (importlib.resources.files("haptic_teleop_omni") / "udev" / RULE).read_text("utf-8")


def checks(root: Path = Path("/")) -> list[Check]:
    """`root`: where /dev, /sys and /etc are looked for."""
    return [_library(), _device(root), _rule(root), _layout(), _calibration()]


def _library() -> Check:
    if not any(importlib.util.find_spec(name) for name in MODULES):
        return Check("hidapi", ABSENT, "Python finds no module hid", "run `pip install hidapi`")
    return Check("hidapi", OK, "installed")


def _device(root: Path) -> Check:
    for entry in sorted((root / "sys/class/hidraw").glob("hidraw*")):
        if HID_NUMBERS in _text(entry / "device/uevent").upper():
            node = root / "dev" / entry.name
            if not os.access(node, os.R_OK | os.W_OK):
                rule = f"haptic-teleop doctor --udev-rule | sudo tee /etc/udev/rules.d/{RULE}"
                return Check(
                    "Omni", BAD, f"Touch (HID) at {node} may not be opened", f"run `{rule}` and replug"
                )
            return Check("Omni", OK, f"Touch (HID) at {node}")
    for entry in sorted((root / "sys/bus/firewire/devices").glob("fw*")):
        if _text(entry / "vendor").strip().lower() == FIREWIRE_VENDOR:
            return Check(
                "Omni",
                BAD,
                f"Phantom Omni on FireWire ({entry.name})",
                "hidapi cannot open it; it needs a FireWire transport, which this project does not have",
            )
    for entry in sorted((root / "sys/bus/usb/devices").glob("*")):
        if (_text(entry / "idVendor").strip(), _text(entry / "idProduct").strip()) == USB_SERIAL:
            return Check(
                "Omni",
                BAD,
                "Touch with a serial port (2988:0302)",
                "its protocol is not published; use the maker's driver",
            )
    return Check("Omni", ABSENT, "no device on HID, FireWire or USB", "connect it, or set device: emulated")


def _rule(root: Path) -> Check:
    for folder in ("etc/udev/rules.d", "lib/udev/rules.d", "usr/lib/udev/rules.d"):
        if (root / folder / RULE).is_file():
            return Check("udev rule", OK, f"/{folder}/{RULE}")
    remedy = f"haptic-teleop doctor --udev-rule | sudo tee /etc/udev/rules.d/{RULE}"
    return Check("udev rule", ABSENT, "not installed", f"run `{remedy}`")


def _layout() -> Check:
    return Check(
        "report layout",
        ABSENT,
        "that of the Touch is published nowhere: a real device gets no torque until somebody confirms one",
        "see docs/drivers.md, layout_confirmed_for",
    )


def _calibration() -> Check:
    return Check(
        "calibration",
        OK,
        "done by the driver at every start (parameter calibration.method); no torque before it",
    )


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""
