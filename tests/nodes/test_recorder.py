"""The recorder as its own process, fed by publishers in this one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_graph import Graph
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.recorder import Recorder as RecorderNode
from haptic_teleop_control.nodes.streams.joint_states import STREAM_QOS
from haptic_teleop_control.recording import bag_problems, read_recording
from haptic_teleop_control.recording.recover import main as recover

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

    def stop(self, number: int = signal.SIGINT) -> tuple[int, str, str]:
        """Exit status, standard output and standard error."""
        self.process.send_signal(number)
        out, err = self.process.communicate(timeout=20)
        return self.process.returncode, out, err


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

    def __init__(self, graph: Graph, count: int, qos: QoSProfile = STREAM_QOS) -> None:
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


@pytest.mark.wall_time
@pytest.mark.parametrize("qos", [STREAM_QOS, RELIABLE], ids=["best_effort", "reliable"])
def test_two_seconds_at_1_khz_are_recorded_without_loss_with_the_parameters_of_the_graph(
    graph, start_recorder, tmp_path, qos, stalls
):
    graph.probe.declare_parameter("gain", 2.5)
    recorder = start_recorder(tmp_path / "a", experiment="free motion", note="a test")
    source = Source(graph, 2000, qos)
    finish(graph, source)
    status, out, err = recorder.stop()
    recording = read_recording(tmp_path / "a")
    assert recording.complete, recording.problems
    one = recording.topics["/sfj/joint_states"]
    lost = 2000 - len(one)
    assert status == 0, err
    assert f"{2000 - lost} messages on 1 topics" in out
    assert f"{lost} lost on the way, verified" in out, "what is lost is counted"
    assert np.all(np.diff(one.position[:, 0]) > 0)
    # Best effort loses what comes while a machine stands still; reliable loses nothing.
    assert lost == 0 or (qos is STREAM_QOS and stalls.excuse(0.1))
    assert recording.parameters["/probe"]["gain"] == 2.5
    assert recording.parameters["/recorder"]["experiment"] == "free motion"
    assert recording.experiment == {"kind": "free motion", "note": "a test"}
    assert recording.reception["lost_on_the_way"] == {"/sfj/joint_states": lost}
    latency = bag_problems(one).latency
    assert latency > 0
    assert latency < 0.1 or stalls.excuse(0.1)


@pytest.mark.wall_time
def test_a_killed_recorder_loses_at_most_the_last_second(graph, start_recorder, tmp_path, stalls):
    recorder = start_recorder(tmp_path / "a")
    source = Source(graph, 3000, RELIABLE)
    finish(graph, source)
    recorder.process.kill()
    recorder.process.communicate()
    assert not read_recording(tmp_path / "a").complete
    assert recover([str(tmp_path / "a"), "--output", str(tmp_path / "b")]) == 3
    recovered = read_recording(tmp_path / "b")
    assert recovered.complete, recovered.problems
    position = recovered.topics["/sfj/joint_states"].position[:, 0]
    assert len(position) >= 2000 or stalls.excuse(1.0)
    assert np.array_equal(position, np.arange(float(len(position))))
    assert "/recorder" in recovered.parameters


def test_a_parameter_changed_while_recording_is_kept_beside_the_first(graph, start_recorder, tmp_path):
    graph.probe.declare_parameter("gain", 2.5)
    recorder = start_recorder(tmp_path / "a")
    source = Source(graph, 800)
    finish(graph, source)
    graph.probe.set_parameters([type(graph.probe.get_parameter("gain"))("gain", value=4.0)])
    graph.listen(0.3)
    recorder.stop()
    recording = read_recording(tmp_path / "a")
    assert recording.parameters["/probe"]["gain"] == 2.5
    assert recording.parameters_at_stop["/probe"]["gain"] == 4.0


def test_topics_of_other_and_of_unknown_types_are_recorded_as_they_are(graph, start_recorder, tmp_path):
    recorder = start_recorder(tmp_path / "a", topics="[/diagnostics, /own]")
    own = graph.probe.create_publisher(JointState, "/own", 10)
    diagnostics = graph.probe.create_publisher(DiagnosticArray, "/diagnostics", 10)
    graph.until(lambda: diagnostics.get_subscription_count(), 20.0)
    recorder_hears(graph, "/own", "1 (reliable)")
    for _ in range(5):
        own.publish(JointState(name=["j"], position=[1.0]))
        diagnostics.publish(DiagnosticArray())
        graph.listen(0.02)
    graph.listen(0.3)
    status, _, err = recorder.stop(signal.SIGTERM)
    assert status == 0, err
    recording = read_recording(tmp_path / "a")
    assert recording.types == {
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        "/own": "sensor_msgs/msg/JointState",
    }
    assert recording.counts["/own"] == 5
    assert recording.counts["/diagnostics"] >= 5  # the recorder's own are among them


def test_it_stops_by_itself_and_says_when_nothing_came(start_recorder, tmp_path):
    recorder = start_recorder(tmp_path / "a", duration=0.5)
    out, err = recorder.process.communicate(timeout=20)
    assert recorder.process.returncode == 1
    assert "/sfj/joint_states: no messages: nobody publishes it" in err
    assert "0 messages" in out


def test_an_existing_output_is_refused(start_recorder, tmp_path):
    (tmp_path / "a").mkdir()
    recorder = start_recorder(tmp_path / "a")
    _, err = recorder.process.communicate(timeout=20)
    assert recorder.process.returncode == 2
    assert "it exists already" in err


def test_it_ends_cleanly_when_too_little_space_is_free(graph, start_recorder, tmp_path):
    recorder = start_recorder(tmp_path / "a", minimum_free_space=10**18)
    out, err = recorder.process.communicate(timeout=20)
    assert recorder.process.returncode == 1
    assert "MB are free" in err
    assert "with errors" in out
    assert "MB are free" in (tmp_path / "a" / "metadata.yaml").read_text(), "for `verify`"


class Late:
    """A recorder's messages, so many of which arrive with each look."""

    _take_the_last = RecorderNode._take_the_last

    def __init__(self, turns: list[int]) -> None:
        self.turns, self.received = turns, {"/sfj/effort_command": 0}

    def spin_once(self, executor: object) -> None:
        self.received["/sfj/effort_command"] += self.turns.pop(0)


def test_what_was_sent_before_the_end_is_taken_though_it_comes_later():
    late = Late([3, *[0] * 9, 1, *[0] * 10])
    late._take_the_last(None)
    assert late.received == {"/sfj/effort_command": 4} and not late.turns
    assert late._last <= time.time_ns()


def test_a_sender_that_goes_on_does_not_keep_the_recorder():
    endless = Late([1] * 1000)
    endless._take_the_last(None)
    assert 0 < len(endless.turns) < 1000
