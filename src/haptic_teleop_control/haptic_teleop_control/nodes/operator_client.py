"""One call of a service of a running node, or a look at the controller's state or at the drivers' devices."""

from __future__ import annotations

import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from haptic_teleop_control.errors import ConfigurationError

SETTLE, ROUND = 0.2, 1.5
"""s for the last of several kept messages; in which every node tells its diagnostics."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def call(called: str, act: str, wait: float, remedy: str) -> tuple[bool, str]:
    """Whether `act` succeeded, and what the node `called` said. Raises ConfigurationError, which ends
    with `remedy`, when it is not there within `wait` s."""
    rclpy.init(args=[])
    node = Node("operate", start_parameter_services=False)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + wait
    try:
        if act == "devices":
            found: dict[str, str] = {}
            told = False
            node.create_subscription(DiagnosticArray, "/diagnostics", lambda m: found.update(_devices(m)), 10)
            while time.monotonic() < deadline:
                executor.spin_once(timeout_sec=0.05)
                if found and not told:  # every node speaks once a second
                    told, deadline = True, min(deadline, time.monotonic() + ROUND)
            if found:
                return True, "\n".join(found[name] for name in sorted(found))
            called = "a driver"
        elif act == "state":
            seen: list[str] = []
            node.create_subscription(String, f"{called}/state", lambda m: seen.append(m.data), LATCHED)
            while not seen and time.monotonic() < deadline:
                executor.spin_once(timeout_sec=0.05)
            executor.spin_once(timeout_sec=SETTLE)  # the last of several that are kept for late comers
            if seen:
                return True, seen[-1]
        else:
            client = node.create_client(Trigger, f"{called}/{act}")
            if client.wait_for_service(timeout_sec=wait):
                future = client.call_async(Trigger.Request())
                executor.spin_until_future_complete(future, timeout_sec=max(1.0, deadline - time.monotonic()))
                answer = future.result()
                if answer is not None:
                    return answer.success, answer.message
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    raise ConfigurationError(f"{called} does not answer within {wait:g} s: {remedy}")


def _devices(message: DiagnosticArray) -> dict[str, str]:
    """A line for each driver that a message of diagnostics tells of, by the driver's name."""
    lines = {}
    for status in message.status:
        told = {entry.key: entry.value for entry in status.values}
        if "device" in told:
            serial = told.get("serial", "none")
            where = f"{told['device']}, {told['transport']}" if "transport" in told else told["device"]
            number = "" if serial == "none" else f", serial number {serial}"
            lines[status.name] = f"{status.name}: {where}{number}: {status.message}"
    return lines
