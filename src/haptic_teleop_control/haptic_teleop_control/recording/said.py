"""What the nodes of a recording said of themselves: diagnostics, and the states that they entered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rosbags.typesys import Stores, get_typestore

from haptic_teleop_control.recording.texts import STRING_TYPE

DIAGNOSTICS_TYPE = "diagnostic_msgs/msg/DiagnosticArray"
STATE = "/state"
"""End of the names of the topics on which a node publishes the state that it enters, as a text."""


@dataclass(frozen=True)
class Status:
    """A node's diagnostics at one time. received: ns. level: 0 OK, 1 warning, 2 error, 3 stale. values: as
    the node wrote them, by name."""

    received: int
    node: str
    level: int
    message: str
    values: dict[str, str]


def is_said(topic: str, kind: str) -> bool:
    """Whether a topic of that type is decoded as what a node says of itself."""
    short = kind.replace("/msg/", "/")
    return short == DIAGNOSTICS_TYPE.replace("/msg/", "/") or (
        short == STRING_TYPE.replace("/msg/", "/") and topic.endswith(STATE)
    )


def states_in(messages: Sequence[tuple[int, bytes]]) -> tuple[list[tuple[int, str]], int]:
    """(received ns, text) of each std_msgs/String in order of time, and how many could not be decoded."""
    decoded, bad = _decoded(messages, STRING_TYPE)
    return [(received, str(message.data)) for received, message in decoded], bad


def diagnostics_in(messages: Sequence[tuple[int, bytes]]) -> tuple[list[Status], int]:
    """Each status of each diagnostic_msgs/DiagnosticArray in order of time, and how many messages could not
    be decoded."""
    decoded, bad = _decoded(messages, DIAGNOSTICS_TYPE)
    found = [
        Status(
            received,
            str(one.name),
            int(one.level),
            str(one.message),
            {str(pair.key): str(pair.value) for pair in one.values},
        )
        for received, message in decoded
        for one in message.status
    ]
    return found, bad


def _decoded(messages: Sequence[tuple[int, bytes]], kind: str) -> tuple[list[tuple[int, Any]], int]:
    store = get_typestore(Stores.ROS2_KILTED)
    found: list[tuple[int, Any]] = []
    for received, data in sorted(messages, key=lambda one: one[0]):
        try:
            found.append((received, store.deserialize_cdr(data, kind)))
        except Exception:
            continue
    return found, len(messages) - len(found)
