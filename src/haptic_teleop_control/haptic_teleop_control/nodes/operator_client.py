"""One call of a service of a running node, or a look at the controller's state."""

from __future__ import annotations

import time

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import GetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.graph_client import GraphClient, graph_client
from haptic_teleop_control.teleoperation.machine import State

REPORTED_WITHIN = 1.5
"""s: diagnostics come at 1 Hz."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def call(called: str, act: str, wait: float, remedy: str) -> int:
    """Has the node `called` do `act`, and prints what it said. Returns 0 when it did, 1 when it refused.
    A ConfigurationError, which ends with `remedy`, when it does not answer within `wait` s: printed, and
    SystemExit."""
    with graph_client("operate") as client:
        done, message = _call(client, called, act, wait, remedy)
        print(message)
        client.status = 0 if done else 1
        return client.status


def _call(client: GraphClient, called: str, act: str, wait: float, remedy: str) -> tuple[bool, str]:
    if act == "state":
        told = _state(client, called, wait)
        if told:
            return True, told
        raise ConfigurationError(f"{called} does not answer within {wait:g} s: {remedy}")
    deadline = time.monotonic() + wait
    service = client.node.create_client(Trigger, f"{called}/{act}")
    # Made after it, so announced after it: who answers this question can answer the service, too. An act that
    # was done and not answered must not be asked for again: swapped twice is not swapped.
    question = client.node.create_client(GetParameters, f"{called}/get_parameters")
    ready = client.until(lambda: service.service_is_ready() and question.service_is_ready(), wait, called)
    known = ready and client.ask(lambda: question.call_async(GetParameters.Request()), deadline)
    if not known:
        raise ConfigurationError(f"{called} does not answer within {wait:g} s: {remedy}")
    future = service.call_async(Trigger.Request())
    client.until(future.done, max(1.0, deadline - time.monotonic()), f"an answer of {called}")
    answer = future.result() if future.done() else None
    if answer is None:
        raise ConfigurationError(
            f"{called} was asked and has not answered within {wait:g} s: look with `operate state` whether "
            "it did."
        )
    return answer.success, answer.message


def _state(client: GraphClient, called: str, wait: float) -> str:
    """The controller's state, and why it is not engaged; empty when it is not heard."""
    seen: list[str] = []
    client.node.create_subscription(String, f"{called}/state", lambda m: seen.append(m.data), LATCHED)
    if not client.until(lambda: bool(seen), wait, called):
        return ""
    client.hear_kept()  # the last of several counts
    if seen[-1] == State.ENGAGED.value:
        return seen[-1]
    told = _sentence(client, called)
    return seen[-1] + (f"\n  {told}" if told and told != seen[-1] else "")


def _sentence(client: GraphClient, called: str) -> str:
    """What the node says of itself in its diagnostics: its fault, or what it waits for; empty when nothing
    comes."""
    told: list[str] = []

    def take(message: DiagnosticArray) -> None:
        told.extend(status.message for status in message.status if status.name == called)

    client.node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
    client.until(lambda: bool(told), REPORTED_WITHIN, called)
    return told[-1] if told else ""
