"""The recorder at the full rate of a robot, and killed in its middle."""

import numpy as np
import pytest
from recorder_runs import RELIABLE, Source, finish

from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS
from haptic_teleop_control.recording import bag_problems, read_recording
from haptic_teleop_control.recording.recover import main as recover


@pytest.mark.wall_time
@pytest.mark.parametrize("qos", [LATEST_QOS, RELIABLE], ids=["best_effort", "reliable"])
def test_two_seconds_at_1_khz_are_recorded_without_loss_with_the_parameters_of_the_graph(
    graph, start_recorder, tmp_path, qos, stalls
):
    graph.probe.declare_parameter("gain", 2.5)
    recorder = start_recorder(tmp_path / "a", experiment="free motion", note="a test")
    source = Source(graph, 2000, qos)
    finish(graph, source)
    status, out, err = recorder.stop(answers=graph)
    recording = read_recording(tmp_path / "a")
    assert recording.complete, recording.problems
    one = recording.topics["/sfj/joint_states"]
    lost = 2000 - len(one)
    assert status == 0, err
    assert f"{2000 - lost} messages on 1 topics" in out
    assert f"{lost} lost on the way, verified" in out, "what is lost is counted"
    assert np.all(np.diff(one.position[:, 0]) > 0)
    # Best effort loses what comes while a machine stands still; reliable loses nothing.
    assert lost == 0 or (qos is LATEST_QOS and stalls.excuse(0.1))
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
