import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2: `make setup`, or source an installation")

sys.path.insert(
    0, str(Path(__file__).parent)
)  # pytest's importlib mode leaves helpers beside the tests unfound

from recorder_runs import Recorder
from ros_graph import Graph


@pytest.fixture
def graph(ros_isolation: None) -> Iterator[Graph]:
    graph = Graph()
    yield graph
    graph.close()


@pytest.fixture
def start_recorder(ros_isolation: None):
    running: list[Recorder] = []

    def start(output: Path, **parameters: object) -> Recorder:
        running.append(Recorder(output, **parameters))
        return running[-1]

    yield start
    for recorder in running:
        if recorder.process.poll() is None:
            recorder.process.kill()
            recorder.process.communicate()
