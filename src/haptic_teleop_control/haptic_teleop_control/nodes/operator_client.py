"""One call of a service of a running node, or a look at the controller's state."""

from __future__ import annotations

import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from haptic_teleop_control.errors import ConfigurationError

SETTLE = 0.2
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
        if act == "state":
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
