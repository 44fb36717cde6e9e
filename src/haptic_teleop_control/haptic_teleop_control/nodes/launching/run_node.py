"""A run of `scenario` as the other runs in its ROS domain see it: a hidden node whose name tells when it
began.

Two runs that are started together find each other's nodes on their topics. By these names both know which one
goes on.
"""

from __future__ import annotations

import re
import time

from rclpy.node import Node

_NAME = re.compile(r"_run_(\d+)_(\w+)")


class RunNode(Node):
    """The node of the run with that id, begun now. key: orders runs by their beginning."""

    def __init__(self, run: str) -> None:
        self.key = (time.time_ns(), run)
        name = f"_run_{self.key[0]}_{run}"
        super().__init__(name, start_parameter_services=False, enable_rosout=False)

    def others(self) -> list[tuple[int, str]]:
        """The keys of all other runs that the graph knows."""
        names = (_NAME.fullmatch(name) for name in self.get_node_names())
        keys = {(int(found[1]), found[2]) for found in names if found}
        return sorted(keys - {self.key})
