"""Prints the messages of a topic as YAML."""

from __future__ import annotations

import importlib
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.graph_client import GraphClient, graph_client, known
from haptic_teleop_control.nodes.streams.senders import full_name
from haptic_teleop_control.senders import NAMELESS
from haptic_teleop_control.strict_yaml import dump_yaml

DEPTH = 100
OF_EVERY_NODE = ("/parameter_events", "/rosout")
QUIET = 3.0
"""s without a message, from when a publisher was found, after which that is said."""
POLL = 1.0
"""s between two looks whether Ctrl-C came, while nothing is published."""


def print_messages(topic: str, count: int | None, wait: float, show: Callable[[str], None] = print) -> None:
    """Shows `count` messages, or all until Ctrl-C; one alone is the latest of those kept.

    Raises ConfigurationError when nobody publishes on `topic` within `wait` s, or in a type of message that
    is not installed.
    """
    full = f"/{topic.strip('/')}"
    with graph_client("echo") as client:
        kind = _type(client, full, wait)
        waiting: deque[Any] = deque()
        quality = _quality(client, full)
        client.node.create_subscription(kind, full, lambda m: waiting.append(m), quality)
        if count == 1 and quality.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            client.until(lambda: bool(waiting), wait)
            client.hear_kept()
            while len(waiting) > 1:
                waiting.popleft()
        shown, began, told = 0, time.monotonic(), False
        while count is None or shown < count:
            client.until(lambda: bool(waiting), POLL)
            if not waiting and not shown and not told and time.monotonic() > began + QUIET:
                print(_silent(client, full), file=sys.stderr, flush=True)
                told = True
            while waiting and (count is None or shown < count):
                show(f"{dump_yaml(plain(waiting.popleft())).rstrip()}\n---")
                shown += 1
        client.status = 0


def _silent(client: GraphClient, topic: str) -> str:
    """What to say where a topic has publishers and no message comes."""
    ends = client.node.get_publishers_info_by_topic(topic)
    names = ", ".join(sorted({full_name(end) or NAMELESS for end in ends})) or "nobody any more"
    return (
        f"nothing has come on {topic} in {QUIET:g} s, which {names} can publish on; Ctrl-C ends the "
        "wait. Where simulated time is paused, `haptic-teleop operate resume` lets it go on."
    )


def plain(value: Any) -> Any:
    """A message as dictionaries, lists and numbers."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (bytes, bytearray)):
        return list(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    return [plain(element) for element in value] if isinstance(value, (list, tuple)) else value


def _type(client: GraphClient, topic: str, wait: float) -> Any:
    def published() -> dict[str, list[str]]:
        there = dict(client.node.get_topic_names_and_types())
        return {name: types for name, types in there.items() if client.node.count_publishers(name)}

    if not client.until(lambda: topic in published(), wait, f"somebody who publishes {topic}"):
        others = [name for name in published() if name not in OF_EVERY_NODE]
        raise ConfigurationError(f"nobody publishes {topic} within {wait:g} s; {known(others, topic)}")
    package, _, name = published()[topic][0].partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ModuleNotFoundError, AttributeError) as missing:
        raise ConfigurationError(
            f"{topic} has messages of type {package}/msg/{name}, which are not installed here: source the "
            "installation that has them."
        ) from missing


def _quality(client: GraphClient, topic: str) -> QoSProfile:
    """What every publisher can serve, the last message for late comers where it is kept."""
    offered = [info.qos_profile for info in client.node.get_publishers_info_by_topic(topic)]
    kept = bool(offered) and all(q.durability == DurabilityPolicy.TRANSIENT_LOCAL for q in offered)
    surely = bool(offered) and all(q.reliability == ReliabilityPolicy.RELIABLE for q in offered)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=DEPTH,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        reliability=ReliabilityPolicy.RELIABLE if surely else ReliabilityPolicy.BEST_EFFORT,
    )
