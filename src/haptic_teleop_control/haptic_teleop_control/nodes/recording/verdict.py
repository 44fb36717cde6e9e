"""What the recorder says when it has stopped."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from haptic_teleop_control.nodes.recording.recorded_topic import RecordedTopic


def print_verdict(
    path: Path,
    topics: Sequence[RecordedTopic],
    received: Mapping[str, int],
    problems: Sequence[str],
    elapsed: float,
    told: Sequence[str] = (),
) -> int:
    """Prints one line on standard output, and on standard error what is odd; exit status 0, or 1 with
    `problems` or without a message.

    received: messages by topic. elapsed: s. told: problems that somebody else tells on the terminal. "Lost
    on the way" are messages that their publisher numbered and that did not arrive here; samples that were
    never taken do not count.
    """
    if sys.stderr.isatty():
        print(file=sys.stderr)
    for topic in topics:
        if topic.missed:
            print(f"{topic.name}: {topic.missed} messages were lost on the way here", file=sys.stderr)
        elif not received.get(topic.name):
            there = f"its {topic.publishers} publishers sent none"
            why = there if topic.publishers else "nobody publishes it"
            print(f"{topic.name}: no messages: {why}", file=sys.stderr)
    total = sum(received.values())
    if not total:
        problems = [*problems, "nothing was received: start the nodes, with the same ROS_DOMAIN_ID"]
    for problem in problems:
        if problem in told:
            continue
        print(f"error: {problem}", file=sys.stderr)
    missed = sum(topic.missed for topic in topics)
    print(
        f"{path}: {total} messages on {len(received)} topics in {elapsed:.1f} s, {missed} lost on the way, "
        f"{'with errors' if problems else 'verified'}"
    )
    return 1 if problems else 0
