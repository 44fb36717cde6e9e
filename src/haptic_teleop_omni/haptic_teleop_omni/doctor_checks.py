"""What `doctor` looks at for the Omni: libraries, the device by its kind of link, rights, confirmations."""

from __future__ import annotations

import importlib.resources
import importlib.util
import os
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.health import ABSENT, BAD, OK, Check
from haptic_teleop_omni.confirmation import confirmation_file, confirmed_identities
from haptic_teleop_omni.transports.hd_library import load_library
from haptic_teleop_omni.transports.hidapi import MODULES

RULE = "60-haptic-teleop.rules"
HID_NUMBERS = "00002988:00000304"
USB_SERIAL = ("2988", "0302")
FIREWIRE_VENDOR = "0x000b99"
INSTALL_RULE = f"haptic-teleop doctor --udev-rule | sudo tee /etc/udev/rules.d/{RULE}"


def udev_rule() -> str:
    """The rules file that lets the logged-in user open the device."""
    return (importlib.resources.files("haptic_teleop_omni") / "udev" / RULE).read_text("utf-8")


def checks(root: Path = Path("/")) -> list[Check]:
    """`root`: where /dev, /sys and /etc are looked for."""
    return [
        _openhaptics(),
        _configuration(),
        _hidapi(),
        _device(root),
        _rule(root),
        _confirmed(),
        _calibration(),
    ]


def _openhaptics() -> Check:
    try:
        library = load_library()
    except ConfigurationError:
        return Check(
            "OpenHaptics",
            ABSENT,
            "the system's loader finds no libHD.so with the calls of version 3",
            "install the vendor's OpenHaptics and driver (docs/drivers.md), or set openhaptics.library",
        )
    return Check("OpenHaptics", OK, f"{library.path} has every call that the driver needs")


def _configuration() -> Check:
    folder = Path(os.environ.get("GTDD_HOME") or Path.home() / ".3dsystems")
    if folder.is_dir():
        return Check("OpenHaptics configuration", OK, f"{folder}")
    return Check(
        "OpenHaptics configuration",
        ABSENT,
        f"there is no {folder}",
        "run the vendor's set-up tool once as this user, or set GTDD_HOME to where it has written",
    )


def _hidapi() -> Check:
    if not any(importlib.util.find_spec(name) for name in MODULES):
        return Check("hidapi", ABSENT, "Python finds no module hid", "for transport: hid, pip install it")
    return Check("hidapi", OK, "installed, for transport: hid")


def _device(root: Path) -> Check:
    for entry in sorted((root / "sys/class/hidraw").glob("hidraw*")):
        if HID_NUMBERS in _text(entry / "device/uevent").upper():
            return _reachable("Touch (HID)", root / "dev" / entry.name)
    for entry in sorted((root / "sys/bus/firewire/devices").glob("fw*")):
        if _text(entry / "vendor").strip().lower() == FIREWIRE_VENDOR:
            return _reachable("Phantom Omni on FireWire", root / "dev" / entry.name.split(".")[0])
    for entry in sorted((root / "sys/bus/usb/devices").glob("*")):
        if (_text(entry / "idVendor").strip(), _text(entry / "idProduct").strip()) == USB_SERIAL:
            ports = sorted(entry.glob("*/tty/ttyACM*"))
            name = ports[0].name if ports else "ttyACM0"
            return _reachable("Touch (USB)", root / "dev" / name)
    return Check(
        "Omni",
        ABSENT,
        "no device on HID, FireWire or USB; one on Ethernet cannot be seen from here",
        "connect it, or set device: emulated",
    )


def _reachable(what: str, node: Path) -> Check:
    if os.access(node, os.R_OK | os.W_OK):
        return Check("Omni", OK, f"{what} at {node}; transport: openhaptics reaches it")
    return Check("Omni", BAD, f"{what} at {node} may not be opened", f"run `{INSTALL_RULE}` and replug")


def _rule(root: Path) -> Check:
    for folder in ("etc/udev/rules.d", "lib/udev/rules.d", "usr/lib/udev/rules.d"):
        if (root / folder / RULE).is_file():
            return Check("udev rule", OK, f"/{folder}/{RULE}")
    return Check("udev rule", ABSENT, "not installed", f"run `{INSTALL_RULE}`")


def _confirmed() -> Check:
    path = confirmation_file()
    try:
        known = confirmed_identities(path)
    except ConfigurationError as error:
        return Check("confirmed Omnis", BAD, str(error).rstrip("."), "see there")
    if known:
        return Check("confirmed Omnis", OK, f"{', '.join(known)} in {path}")
    return Check(
        "confirmed Omnis",
        ABSENT,
        "none: a real device gets no torque before its axes were verified by hand",
        "run `haptic-teleop doctor --omni`",
    )


def _calibration() -> Check:
    return Check(
        "calibration",
        OK,
        "done at every start, by the vendor's library or as calibration.method says; no torque before it",
    )


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""
