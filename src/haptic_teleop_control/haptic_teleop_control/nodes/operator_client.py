"""One call of a service of the running controller, or a look at its state."""

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


def call(controller: str, act: str, wait: float) -> tuple[bool, str]:
    """Whether `act` succeeded, and what the controller said. Raises ConfigurationError when the controller is
    not there within `wait` s."""
    rclpy.init(args=[])
    node = Node("operate", start_parameter_services=False)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + wait
    try:
        if act == "state":
            seen: list[str] = []
            node.create_subscription(String, f"{controller}/state", lambda m: seen.append(m.data), LATCHED)
            while not seen and time.monotonic() < deadline:
                executor.spin_once(timeout_sec=0.05)
            executor.spin_once(timeout_sec=SETTLE)  # the last of several that are kept for late comers
            if seen:
                return True, seen[-1]
        else:
            client = node.create_client(Trigger, f"{controller}/{act}")
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
    raise ConfigurationError(
        f"{controller} does not answer within {wait:g} s; start a scenario with the same ROS_DOMAIN_ID first."
    )
