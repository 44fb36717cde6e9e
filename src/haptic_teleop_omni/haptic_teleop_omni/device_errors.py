"""What the codes in a report's field `error` mean: those of the vendor's HD library, and one of our callback.

Codes and names are those of the library's public headers; the remedies are what users of its ROS drivers
report to have helped (docs/drivers.md).
"""

from __future__ import annotations

from dataclasses import dataclass

DEVICE_LOST, LIBRARY_ERROR = "device_lost", "library_error"
WATCHDOG = 0xF000
"""Not the library's: no torque came for too long, so the callback took it to zero."""

BAD_HANDLE, WARM_MOTORS, MAX_FORCE, ALREADY_INITIATED = 0x0104, 0x0200, 0x0201, 0x0301
COMMUNICATION, CONFIGURATION, LICENCE = 0x0302, 0x0303, 0x0600

ERROR_FAULTS = {
    "warm_motors": "the motors are too warm; let them rest for some minutes without torque, lower "
    "torque.continuous, then reset",
    "force_refused": "the library rejects the commanded force, or the speed is too high; "
    "lower torque.peak, then reset",
    LIBRARY_ERROR: "the library reports an error; look its code up in docs/drivers.md, then reset",
    "watchdog_expired": "no torque came for too long, so the library's callback switched it off; stop other "
    "programs or set realtime_priority, then reset",
}
"""Faults that these codes lead to, with the sentence for the log; beside them `device_lost`."""


@dataclass(frozen=True)
class DeviceProblem:
    """fault: name of the fault. text: the code's name and, where there is more to say, the remedy."""

    fault: str
    text: str


_CABLE = (
    "look at cable and power, at the port that the vendor's set-up tool has stored (GTDD_HOME), and at the "
    "rights on it: /dev/fw* (FireWire), /dev/ttyACM* (Touch USB), /dev/hidraw* (Touch HID)"
)
_PROBLEMS = {
    BAD_HANDLE: DeviceProblem(DEVICE_LOST, "HD_BAD_HANDLE"),
    WARM_MOTORS: DeviceProblem("warm_motors", "HD_WARM_MOTORS"),
    MAX_FORCE: DeviceProblem("force_refused", "HD_EXCEEDED_MAX_FORCE"),
    0x0202: DeviceProblem("force_refused", "HD_EXCEEDED_MAX_FORCE_IMPULSE"),
    0x0203: DeviceProblem("force_refused", "HD_EXCEEDED_MAX_VELOCITY"),
    0x0204: DeviceProblem("force_refused", "HD_FORCE_ERROR"),
    0x0300: DeviceProblem(DEVICE_LOST, f"HD_DEVICE_FAULT: switch the device off and on, and {_CABLE}"),
    ALREADY_INITIATED: DeviceProblem(
        DEVICE_LOST, "HD_DEVICE_ALREADY_INITIATED: another program or driver uses this device; end it"
    ),
    COMMUNICATION: DeviceProblem(DEVICE_LOST, f"HD_COMM_ERROR: {_CABLE}"),
    CONFIGURATION: DeviceProblem(
        DEVICE_LOST,
        "HD_COMM_CONFIG_ERROR: the configuration knows no device of this name; make one with the vendor's "
        "set-up tool, or name yours with openhaptics.device_name",
    ),
    0x0304: DeviceProblem(DEVICE_LOST, "HD_TIMER_ERROR: the library's servo thread does not run"),
    LICENCE: DeviceProblem(
        DEVICE_LOST,
        "HD_INVALID_LICENSE: old versions ask for a licence in a window; install it, or a newer version",
    ),
    WATCHDOG: DeviceProblem("watchdog_expired", "openhaptics.watchdog"),
}


def device_problem(code: int, internal: int = 0) -> DeviceProblem:
    """What `code` of the field `error` is; `internal`: the library's further code. Any code gives a
    problem."""
    known = _PROBLEMS.get(code, DeviceProblem(LIBRARY_ERROR, "see docs/drivers.md"))
    if code == WATCHDOG:
        return known
    further = f", internal {internal}" if internal else ""
    return DeviceProblem(known.fault, f"error 0x{code:04x}{further}, {known.text}")
