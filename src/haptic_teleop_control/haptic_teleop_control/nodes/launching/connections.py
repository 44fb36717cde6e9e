"""Whether the publishers and subscriptions of one process have met those of others.

What a graph query lists is only known to exist. Here an endpoint counts as connected when the middleware has
matched it, too: only then does a sample arrive.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from haptic_teleop_control.nodes.launching.participants import own_participant, participant_of
from haptic_teleop_control.nodes.streams.senders import full_name
from haptic_teleop_control.senders import NAMELESS

OUT, IN, PARTICIPANTS = "publishers", "subscriptions", "participants"
Endpoints = dict[str, dict[str, list[str]]]
"""{"publishers": {topic: [full node name, ...]}, "subscriptions": {...}, "participants": {id of a process:
[names of its nodes]}}; an id is empty where the middleware tells none."""

JOINT_STATE = "sensor_msgs/msg/JointState"
SERVICE_TOPICS = ("/parameter_events", "/rosout")
"""Topics that every node has; nothing here depends on their first message."""


def endpoints(nodes: Iterable[Node]) -> Endpoints:
    """What `nodes` publish and subscribe to."""
    found: Endpoints = {OUT: {}, IN: {}, PARTICIPANTS: {}}
    for node in nodes:
        names = found[PARTICIPANTS].setdefault(own_participant(node), [])
        names.append(node.get_fully_qualified_name())
        for direction, ends in ((OUT, node.publishers), (IN, node.subscriptions)):
            for end in ends:
                if end.topic_name not in SERVICE_TOPICS:
                    found[direction].setdefault(end.topic_name, []).append(node.get_fully_qualified_name())
    return found


def merged(several: Iterable[Endpoints]) -> Endpoints:
    """The endpoints of several processes in one."""
    whole: Endpoints = {OUT: {}, IN: {}, PARTICIPANTS: {}}
    for one in several:
        for direction, topics in one.items():
            for topic, names in topics.items():
                whole[direction].setdefault(topic, []).extend(names)
    return whole


def unconnected(nodes: Iterable[Node], expected: Mapping[str, Mapping[str, list[str]]]) -> list[str]:
    """Topics on which an endpoint of `nodes` has not yet met all its `expected` counterparts, sorted.

    A counterpart has been met when the graph shows it by name and the middleware has matched as many
    endpoints as the graph shows compatible ones.
    """
    missing = set()
    for node in nodes:
        for publisher in node.publishers:
            topic = publisher.topic_name
            seen = node.get_subscriptions_info_by_topic(topic)
            count = publisher.get_subscription_count()
            known = _by_ours(seen, expected)
            if not _met(expected[IN].get(topic, []), known, seen, count, publisher.qos_profile, True):
                missing.add(topic)
        for subscription in node.subscriptions:
            topic = subscription.topic_name
            seen = node.get_publishers_info_by_topic(topic)
            count = subscription.get_publisher_count()
            known = _by_ours(seen, expected)
            if not _met(expected[OUT].get(topic, []), known, seen, count, subscription.qos_profile, False):
                missing.add(topic)
    return sorted(missing - set(SERVICE_TOPICS))


def processes_of(ours: Mapping[str, Mapping[str, list[str]]]) -> frozenset[str]:
    """The ids of our processes; none where the middleware does not tell them."""
    return frozenset(ours[PARTICIPANTS]) if _told(ours) else frozenset()


def strangers(node: Node, ours: Mapping[str, Mapping[str, list[str]]]) -> dict[str, list[str]]:
    """Topic of joint states that we publish -> nodes that are not ours and publish on it, too, as `node` sees
    it; also those of the same name as ours, as a second run of the same file has them. Two commands, or two
    plants, on one topic are never meant."""
    found = {}
    for topic, names in ours[OUT].items():
        ends = [end for end in node.get_publishers_info_by_topic(topic) if end.topic_type == JOINT_STATE]
        known = _by_ours(ends, ours)
        others = Counter(full_name(end) for end in ends if end not in known)
        if not _told(ours):
            others = _others_by_name(ends, names)
        if others:
            found[topic] = [
                f"another {name}" if name in names else name or NAMELESS for name in sorted(others)
            ]
    return found


def _told(ours: Mapping[str, Mapping[str, list[str]]]) -> bool:
    """Whether the middleware tells by an id to which process an endpoint belongs."""
    participants = ours.get(PARTICIPANTS, {})
    return bool(participants) and "" not in participants


def _by_ours(
    ends: list[TopicEndpointInfo], ours: Mapping[str, Mapping[str, list[str]]]
) -> list[TopicEndpointInfo]:
    """Those that belong to our processes, or all where that is not told."""
    if not _told(ours):
        return ends
    return [end for end in ends if participant_of(end) in ours[PARTICIPANTS]]


def _others_by_name(ends: list[TopicEndpointInfo], names: list[str]) -> Counter[str]:
    seen = Counter(full_name(end) for end in ends)
    others, ours_unseen = seen - Counter(names), Counter(names) - seen
    if others[""] <= ours_unseen.total():  # ours, whose names are not known yet
        del others[""]
    return others


def _met(
    expected: list[str],
    known: list[TopicEndpointInfo],
    seen: list[TopicEndpointInfo],
    matched: int,
    own: QoSProfile,
    publishing: bool,
) -> bool:
    if not {full_name(end) for end in known}.issuperset(expected):
        return False
    compatible = 0
    for end in seen:
        offered, wanted = (own, end.qos_profile) if publishing else (end.qos_profile, own)
        verdict, _ = qos_check_compatible(offered, wanted)
        compatible += verdict != QoSCompatibility.ERROR
    return matched >= compatible
