"""The contents of a rosbag2 metadata.yaml, version 9 (ROS 2 Jazzy and later; the reader of Humble takes it
too)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import yaml


class TopicEntry(NamedTuple):
    """A topic as metadata.yaml lists it; ``qos`` are the profiles that its publishers offered."""

    name: str
    kind: str
    hash_: str
    qos: list[dict[str, Any]]


def bag_information(
    file: str,
    span: tuple[int, int] | None,
    topics: Sequence[tuple[TopicEntry, int]],
    custom: Mapping[str, str],
) -> dict[str, Any]:
    """The mapping under ``rosbag2_bagfile_information`` for a recording in one file.

    ``span``: first and last time of reception, ns, None when there are no messages; ``topics`` with their
    number of messages; ``custom``: free texts by key.
    """
    start, end = span or (0, 0)
    count = sum(number for _, number in topics)
    times = {"duration": {"nanoseconds": end - start}, "starting_time": {"nanoseconds_since_epoch": start}}
    return {
        "version": 9,
        "storage_identifier": "mcap",
        **times,
        "message_count": count,
        "topics_with_message_count": [
            {
                "topic_metadata": {
                    "name": topic.name,
                    "type": topic.kind,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": topic.qos,
                    "type_description_hash": topic.hash_,
                },
                "message_count": number,
            }
            for topic, number in topics
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **times, "message_count": count}],
        "custom_data": dict(custom),
        "ros_distro": "unknown",
    }


def offered_qos(text: str) -> list[dict[str, Any]]:
    """The profiles in the text that a channel of an MCAP file carries; [] when it cannot be understood."""
    try:
        profiles = yaml.safe_load(text)
    except yaml.YAMLError:
        return []
    return profiles if isinstance(profiles, list) else []
