import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2: `make setup`, or source an installation")

sys.path.insert(
    0, str(Path(__file__).parent)
)  # pytest's importlib mode leaves helpers beside the tests unfound

from ros_graph import Graph


@pytest.fixture
def graph(ros_isolation: None) -> Iterator[Graph]:
    graph = Graph()
    yield graph
    graph.close()
