"""Whether a recording on disk is what its writer says it wrote."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from haptic_teleop_control.recording.bag_folder import open_bag


def verify_recording(path: Path, written: Mapping[str, int]) -> list[str]:
    """Reads all of the recording at ``path`` and compares the messages on each topic with ``written``.

    Returns sentences; none when all messages are there and every checksum holds. Raises RecordingError when
    there is no recording.
    """
    bag = open_bag(path)
    found: Counter[str] = Counter()
    for batch in bag.batches(lambda name, kind: False):
        found[batch.topic] += batch.count
    bag.check_counts(found)
    for topic, number in written.items():
        if found[topic] != number:
            bag.damage(f"{path}: {found[topic]} of the {number} messages received on {topic} are there")
    return bag.problems
