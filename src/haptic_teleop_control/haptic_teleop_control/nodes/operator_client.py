"""One call of a service of a running node, or a look at the controller's state."""

from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.graph_client import GraphClient, graph_client
from haptic_teleop_control.teleoperation.machine import State

SETTLE = 0.2
REPORTED_WITHIN = 1.5
"""s: diagnostics come at 1 Hz."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def call(called: str, act: str, wait: float, remedy: str) -> tuple[bool, str]:
    """Whether `act` succeeded, and what the node `called` said. Raises ConfigurationError, which ends
    with `remedy`, when it is not there within `wait` s."""
    deadline = time.monotonic() + wait
    with graph_client("operate") as client:
        if act == "state":
            seen: list[str] = []
            client.node.create_subscription(String, f"{called}/state", lambda m: seen.append(m.data), LATCHED)
            if client.until(lambda: bool(seen), wait, called):
                client.executor.spin_once(timeout_sec=SETTLE)  # the last of several kept for late comers
                if seen[-1] == State.ENGAGED.value:
                    return True, seen[-1]
                told = _sentence(client, called)
                return True, seen[-1] + (f"\n  {told}" if told and told != seen[-1] else "")
        else:
            service = client.node.create_client(Trigger, f"{called}/{act}")
            if client.until(service.service_is_ready, wait, called):
                future = service.call_async(Trigger.Request())
                client.until(future.done, max(1.0, deadline - time.monotonic()), f"an answer of {called}")
                answer = future.result() if future.done() else None
                if answer is not None:
                    return answer.success, answer.message
    raise ConfigurationError(f"{called} does not answer within {wait:g} s: {remedy}")


def _sentence(client: GraphClient, called: str) -> str:
    """What the node says of itself in its diagnostics: its fault, or what it waits for; empty when nothing
    comes."""
    told: list[str] = []

    def take(message: DiagnosticArray) -> None:
        told.extend(status.message for status in message.status if status.name == called)

    client.node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
    client.until(lambda: bool(told), REPORTED_WITHIN, called)
    return told[-1] if told else ""
