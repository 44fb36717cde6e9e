"""What a robot's nodes say about their faults, followed over time: a fault that has come and gone counts too.

A robot that is in a fault gives no effort, and after its reset it gives whatever is asked for then.
Diagnostics come once a second, so a fault may be reset between two of them: its counter tells.
"""

from __future__ import annotations

from collections.abc import Mapping

COUNTER = "fault "
"""How the keys of a node's counted faults begin in its diagnostics."""


class RobotFaults:
    """All nodes in the namespace of one robot, "sfj" or "omni", since the start of an experiment."""

    def __init__(self, robot: str) -> None:
        self._place = f"/{robot}/"
        self._counted: dict[str, dict[str, int]] = {}

    def step(self, node: str, sentence: str | None, values: Mapping[str, str]) -> str | None:
        """Takes one status: the node's full name, the sentence of its latched fault (None: it has none) and
        its values. Returns what happened to the robot, in words; None for nothing, and for a node
        elsewhere."""
        if self._place not in node:
            return None
        counts = {key.removeprefix(COUNTER): _whole(values[key]) for key in values if key.startswith(COUNTER)}
        before = self._counted.setdefault(node, counts)  # of what was before the experiment it knows nothing
        if sentence is not None:
            return f"{node}: {sentence}"
        more = [name for name, count in counts.items() if count > before.get(name, 0)]
        return f"{node}: {more[0]}, reset since." if more else None


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        return 0
