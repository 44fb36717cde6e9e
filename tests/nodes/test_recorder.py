"""The recorder as its own process, fed by publishers in this one."""

from __future__ import annotations

import signal
import time
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from recorder_runs import Source, finish, recorder_hears
from sensor_msgs.msg import JointState

from haptic_teleop_control.nodes.recorder import Recorder as RecorderNode
from haptic_teleop_control.recording import read_recording


def test_a_parameter_changed_while_recording_is_kept_beside_the_first(graph, start_recorder, tmp_path):
    graph.probe.declare_parameter("gain", 2.5)
    recorder = start_recorder(tmp_path / "a")
    source = Source(graph, 800)
    finish(graph, source)
    graph.probe.set_parameters([type(graph.probe.get_parameter("gain"))("gain", value=4.0)])
    graph.listen(0.3)
    recorder.stop(answers=graph)
    recording = read_recording(tmp_path / "a")
    assert recording.parameters["/probe"]["gain"] == 2.5
    assert recording.parameters_at_stop["/probe"]["gain"] == 4.0


def test_a_node_that_never_answers_is_named_at_the_end(graph, start_recorder, tmp_path):
    silent = Node("silent", context=graph.context)  # in no executor
    try:
        recorder = start_recorder(tmp_path / "a", parameter_wait=0.3)
        finish(graph, Source(graph, 300))
        _, _, err = recorder.stop(answers=graph)
    finally:
        silent.destroy_node()
    assert "without the parameters of /silent, which did not answer, at last for 0.3 s" in err
    assert "/silent" not in read_recording(tmp_path / "a").parameters


def test_the_text_of_a_model_file_that_a_node_names_is_kept(graph, start_recorder, tmp_path):
    model, secret = tmp_path / "model.yaml", tmp_path / "board.key"
    model.write_text("damping: 2.6  # N·m·s/rad\n", encoding="utf-8")
    secret.write_text("shared with the board")
    for name, value in (("stage1.model", model), ("stage2.model", tmp_path / "absent"), ("key.file", secret)):
        graph.probe.declare_parameter(name, str(value))
    recorder = start_recorder(tmp_path / "a")
    finish(graph, Source(graph, 300))
    recorder.stop(answers=graph)
    assert read_recording(tmp_path / "a").models == {str(model): model.read_text(encoding="utf-8")}


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


class Ending(RecorderNode):
    """A recorder at its end, whose question for parameters breaks off."""

    def __init__(self) -> None:
        self.described: list[str] = []
        self._parent, self.problems, self.received, self._topics, self.started = None, [], {}, [], 0.0
        self.writer = SimpleNamespace(describe=lambda **told: self.described.extend(told))
        self._collector = SimpleNamespace(ask_again=lambda: None)
        self.values = {"parameter_wait": 0.0}

    def _wall_seconds(self) -> float:
        if self.described:
            raise InterruptedError
        return 0.0

    def _take_the_last(self, executor: object) -> None:
        pass


def test_what_was_received_is_told_before_anything_that_may_hang():
    ending = Ending()
    with pytest.raises(InterruptedError):
        ending.finish(None)
    assert ending.described == ["reception"]
