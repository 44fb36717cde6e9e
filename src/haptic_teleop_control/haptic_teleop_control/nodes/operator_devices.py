"""Which device each running driver has, as the drivers' diagnostics tell it."""

from __future__ import annotations

import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from haptic_teleop_control.errors import ConfigurationError

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
    rclpy.init(args=[])
    node = Node("operate", start_parameter_services=False)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    found: dict[str, str] = {}

    deadline = time.monotonic() + wait
    try:
        node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: found.update(told(m)), 50)
        while not found and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.05)
        end = time.monotonic() + ROUND
        while found and time.monotonic() < end:
            executor.spin_once(timeout_sec=0.05)
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
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
