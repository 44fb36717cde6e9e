"""The recorder as its own process, fed by publishers in this one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_graph import Graph
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS

RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
PERIOD = 1_000_000


class Recorder:
    """The executable, started with these parameters; ended by `stop`, or with the test at the latest."""

    def __init__(self, output: Path, **parameters: object) -> None:
        given = {"output": output, "topics": "[/sfj/joint_states]", **parameters}
        arguments = [part for name, value in given.items() for part in ("-p", f"{name}:={value}")]
        command = [
            sys.executable,
            "-m",
            "haptic_teleop_control.front_door",
            "recorder",
            "--ros-args",
            *arguments,
        ]
        self.process = subprocess.Popen(
            command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=dict(os.environ)
        )

    def stop(self, number: int = signal.SIGINT, answers: Graph | None = None) -> tuple[int, str, str]:
        """Exit status, standard output and standard error. ``answers``: whose nodes go on meanwhile, as those
        of a robot do, and answer what the recorder asks at the end."""
        self.process.send_signal(number)
        if answers is not None:
            answers.until(lambda: self.process.poll() is not None, 20.0, "the recorder has ended")
        out, err = self.process.communicate(timeout=20)
        return self.process.returncode, out, err


def recorder_hears(graph: Graph, topic: str, publishers: str) -> None:
    """Until the recorder says that these publish."""
    met: list[str | None] = []

    def look(message: DiagnosticArray) -> None:
        met.extend(v.value for s in message.status for v in s.values if v.key == f"publishers of {topic}")

    told = graph.probe.create_subscription(DiagnosticArray, "/diagnostics", look, 10)
    graph.until(lambda: publishers in met, 20.0, f"the recorder hears {topic}")
    graph.probe.destroy_subscription(told)


class Source:
    """Publishes numbered joint states at 1 kHz from a thread of its own, from the moment that it is heard: so
    says the recorder, because a publisher that has met its reader may not have been met by it."""

    def __init__(self, graph: Graph, count: int, qos: QoSProfile = LATEST_QOS) -> None:
        self.publisher = graph.probe.create_publisher(JointState, "/sfj/joint_states", qos)
        reliable = qos.reliability == ReliabilityPolicy.RELIABLE
        recorder_hears(graph, "/sfj/joint_states", f"1 ({'reliable' if reliable else 'best effort'})")
        self.sent = 0
        self.thread = threading.Thread(target=self._publish, args=(count,))
        self.thread.start()

    def _publish(self, count: int) -> None:
        message = JointState(name=["stage1_motor"], position=[0.0])
        start = time.monotonic_ns()
        for number in range(count):
            time.sleep(max(0, start + number * PERIOD - time.monotonic_ns()) * 1e-9)
            seconds, nanoseconds = divmod(time.time_ns(), 10**9)
            message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
            message.position[0] = float(number)
            self.publisher.publish(message)
            self.sent += 1


def finish(graph: Graph, source: Source) -> None:
    graph.until(lambda: not source.thread.is_alive(), 20.0)
    graph.listen(0.3)
