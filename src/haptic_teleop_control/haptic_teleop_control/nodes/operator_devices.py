"""Which device each running driver has, as the drivers' diagnostics tell it."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.graph_client import graph_client

ROUND = 1.5
"""s after the first driver's diagnostics in which those of all others come: they come once a second."""

TOLD = (
    "device", "board", "transport", "serial number", "layout", "torque output", "calibration", "angles (rad)",
    "measured current (A)",
)  # fmt: skip
"""Values of a driver's diagnostics that say what it drives, whether it may, and for the hand at the robot
what it measures."""


def devices(wait: float) -> list[str]:
    """A line for each driver that runs. Raises ConfigurationError when none is heard within `wait` s."""
    found: dict[str, str] = {}
    with graph_client("operate") as client:
        client.node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: found.update(told(m)), 50)
        if client.until(lambda: bool(found), wait, "a driver"):
            client.until(lambda: False, ROUND)
    if not found:
        raise ConfigurationError(
            f"no driver is heard within {wait:g} s: start a scenario with drivers and the same ROS_DOMAIN_ID "
            "first."
        )
    return [found[name] for name in sorted(found)]


def told(message: DiagnosticArray) -> dict[str, str]:
    """A line for each driver that a message of diagnostics tells of, by the driver's name."""
    lines = {}
    for status in message.status:
        values = {entry.key: entry.value for entry in status.values}
        if "device" in values:
            what = ", ".join(f"{key} {values[key]}" for key in TOLD if values.get(key))
            lines[status.name] = f"{status.name}: {what}: {status.message}"
    return lines
