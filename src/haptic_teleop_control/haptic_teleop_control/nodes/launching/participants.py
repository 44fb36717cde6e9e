"""Which endpoints of the graph belong to which process: by the middleware's ids, because names may be
the same.

Two runs of one file have nodes of the same names. Who goes by names takes a node of the other run for the own
one that has not been discovered yet, and begins.
"""

from __future__ import annotations

import os
import secrets

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import String

from haptic_teleop_control.nodes.streams.senders import PROCESS


def participant_of(end: TopicEndpointInfo) -> str:
    """Hexadecimal id of the participant that the endpoint belongs to."""
    return bytes(end.endpoint_gid)[:PROCESS].hex()


def own_participant(node: Node) -> str:
    """The same of `node`'s own process; empty with a middleware whose ids do not tell it."""
    topics = [f"/_participant_{os.getpid()}_{secrets.token_hex(4)}" for _ in range(2)]
    publishers = [node.create_publisher(String, topic, 1) for topic in topics]
    found = {participant_of(end) for topic in topics for end in node.get_publishers_info_by_topic(topic)}
    for publisher in publishers:
        node.destroy_publisher(publisher)
    return found.pop() if len(found) == 1 else ""
