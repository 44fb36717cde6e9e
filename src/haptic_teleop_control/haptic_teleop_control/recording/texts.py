"""std_msgs/String in recordings: what a latched topic said, and when."""

from __future__ import annotations

from typing import Any

from rosbags.typesys import Stores, get_typestore

STRING_TYPE = "std_msgs/msg/String"

LATCHED_PROFILE: dict[str, Any] = {
    "history": "keep_last",
    "depth": 10,
    "reliability": "reliable",
    "durability": "transient_local",
    "deadline": {"sec": 0, "nsec": 0},
    "lifespan": {"sec": 0, "nsec": 0},
    "liveliness": "automatic",
    "liveliness_lease_duration": {"sec": 0, "nsec": 0},
    "avoid_ros_namespace_conventions": False,
}
"""As rosbag2 writes the profile of a latched publisher, so that who plays the recording offers it again."""


def encode_text(text: str) -> bytes:
    """`text` as a serialised std_msgs/String (CDR)."""
    store = get_typestore(Stores.ROS2_KILTED)
    return bytes(store.serialize_cdr(store.types[STRING_TYPE](data=text), STRING_TYPE))
