"""The message definitions that a recording carries, so that it can be read without the packages that define
them."""

from __future__ import annotations

from functools import cache

from rosbags.typesys import Stores, get_typestore

JOINT_STATE_TYPE = "sensor_msgs/msg/JointState"


@cache
def message_definition(kind: str) -> tuple[str, str]:
    """The ROS definition of a message type with all it contains ("ros2msg" text), and its RIHS01 hash.

    ``kind`` is written like ``sensor_msgs/msg/JointState``. Both are empty for a type that is in no ROS
    distribution.
    """
    store = get_typestore(Stores.ROS2_KILTED)
    if kind not in store.fielddefs:
        return "", ""
    text, _ = store.generate_msgdef(kind, ros_version=2)
    return text, store.hash_rihs01(kind)
