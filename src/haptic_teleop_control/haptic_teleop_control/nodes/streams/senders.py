"""Who publishes on a topic, by the ids that messages carry and the names that the graph knows."""

from __future__ import annotations

import inspect
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import rclpy.subscription
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from haptic_teleop_control.senders import NAMELESS

SENDERS_TOLD = "publisher_gid" in getattr(
    getattr(rclpy.subscription, "MessageInfo", None), "__annotations__", ()
)
"""Whether this rclpy tells who sent a message: 9.1.1 (Kilted) and later do, 7.1 (Jazzy) does not."""

UNTOLD = (
    "this rclpy does not tell who sent a message, so a second sender on a topic is only a warning in the "
    "diagnostics and not a fault; ROS 2 Kilted or later tells it"
)

PROCESS = 12
"""Bytes of a publisher's id that are its process's: DDS numbers participants, and a process (a context) has
one."""

UNKNOWN_NAME = "_NODE_NAME_UNKNOWN_"
"""What the middleware calls a node whose publishers it has found, and whose name it has not been told yet."""

Info = Mapping[str, Any]


def with_info(receive: Callable[[Any, Info], None]) -> Callable[..., None]:
    """A callback for `create_subscription` that calls `receive(message, info)` under every executor: rclpy's
    EventsExecutor (9.1) hands message and info over as one tuple."""

    def callback(message: Any, info: Info | None = None) -> None:
        if info is None:
            message, info = message
        receive(message, info)

    # From this rclpy concludes that the callback wants the info.
    callback.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY) for name in ("message", "info")]
    )
    return callback


def process_of(info: Info) -> str:
    """Hexadecimal id of the process that has sent a message; empty where the middleware does not tell."""
    told = info.get("publisher_gid")
    return "" if told is None else bytes(told["data"])[:PROCESS].hex()


def full_name(end: TopicEndpointInfo) -> str:
    """The name of the endpoint's node with its namespace; empty as long as the graph does not know it."""
    if end.node_name == UNKNOWN_NAME:
        return ""
    return f"{end.node_namespace.rstrip('/')}/{end.node_name}"


def publishers(node: Node, topic: str) -> dict[bytes, str]:
    """Id -> full node name, or empty, of every publisher of `topic` (absolute) that the graph lists."""
    return {bytes(end.endpoint_gid): full_name(end) for end in node.get_publishers_info_by_topic(topic)}


def crowded(node: Node, kind: type) -> list[str]:
    """A sentence for each topic of messages `kind` that `node` hears and that has several publishers, even
    if only one of them sends."""
    found = []
    for subscription in node.subscriptions:
        if subscription.msg_type is kind and subscription.get_publisher_count() > 1:
            topic = subscription.topic_name
            ends: Iterable[TopicEndpointInfo] = node.get_publishers_info_by_topic(topic)
            names = Counter(full_name(end) for end in ends)
            if names.total() > 1:
                several = ", ".join(
                    (name or NAMELESS) + (f" ({count} times)" if count > 1 else "")
                    for name, count in sorted(names.items())
                )
                found.append(
                    f"{topic} has several publishers: {several}; stop all but one (a process that was killed "
                    "is listed for some 20 s)"
                )
    return found
