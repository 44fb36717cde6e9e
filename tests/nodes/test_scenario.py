"""The scenario runner: from one file to processes that run, move the plant, and are gone afterwards."""

import os
import re
import signal
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState
from small_scenario import FILE, start

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.launching import watch
from haptic_teleop_control.nodes.launching.children import Child, stop_all
from haptic_teleop_control.nodes.launching.watch import ProgressLine, Watcher
from haptic_teleop_control.nodes.scenario import _ended_early, load_scenario, main
from haptic_teleop_control.nodes.timing.time_base import LATEST_QOS
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import OMNI_JOINTS


@pytest.fixture
def file(tmp_path) -> Path:
    path = tmp_path / "scenario.yaml"
    path.write_text(FILE)
    return path


def started_by(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def alive(pid: int) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except FileNotFoundError:
        return False


def until(condition, deadline=30.0):
    end = time.monotonic() + deadline
    while not condition():
        assert time.monotonic() < end, "not in time"
        time.sleep(0.02)


@pytest.mark.parametrize("mode", [[], pytest.param(["--processes"], marks=pytest.mark.long)])
def test_a_scenario_moves_the_plant_and_ends_by_itself_with_0(file, mode):
    process = start("scenario", str(file), *mode)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    angles = [
        float(line.split("stage 1:")[1].split()[0]) for line in errors.splitlines() if "stage 1:" in line
    ]
    assert angles[-1] > 0.05, errors


def test_where_there_is_no_terminal_no_line_of_progress_is_printed_twice(monkeypatch, capsys):
    monkeypatch.setattr(watch, "PLAIN_INTERVAL", -1.0)
    with ProgressLine() as progress:
        for text in ("starting composed", "compiling, once", "starting composed", "1.0 s", "1.0 s"):
            progress.show(text)
    assert capsys.readouterr().err.splitlines() == ["starting composed", "compiling, once", "1.0 s"]


def test_a_recorded_scenario_holds_every_sample_and_the_parameters(file, tmp_path):
    bag = tmp_path / "bag"
    process = start("scenario", str(file), "--record", str(bag), "--real-time-factor", "0")
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    recording = read_recording(bag)
    assert recording.complete
    assert abs(recording.topics["/sfj/effort_command"].effort).max() > 0.0
    samples = {name: len(topic) for name, topic in recording.topics.items()}
    assert samples == {
        "/sfj/joint_states": 750, "/sfj/effort_command": 750, "/reference": 300,
        "/omni/joint_states": 750, "/omni/effort_command": 750,
    }  # fmt: skip
    assert len({topic.received[0] for topic in recording.topics.values()}) == 1, "nobody was late"
    assert recording.experiment["kind"] == "scenario" and recording.experiment["planned_duration"] == 1.5
    assert recording.reception["ended"] is True
    assert recording.parameters["/force_controller"]["timeout"] == 0.05


@pytest.mark.parametrize("moment", [0.0, 0.5, 1.5, pytest.param(6.0, marks=pytest.mark.long)])
def test_ctrl_c_ends_everything_with_0_at_any_moment(file, tmp_path, moment):
    bag = tmp_path / "bag"
    process = start("scenario", str(file), "--duration", "0", "--record", str(bag))
    until(lambda: len(started_by(process.pid)) == 2)
    children = started_by(process.pid)
    time.sleep(moment)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    assert not any(alive(child) for child in children)
    # What is there is a recording; before the start there is nothing to keep, and the name stays free.
    if bag.exists():
        recording = read_recording(bag)
        assert recording.complete and recording.reception["ended"] is False


def test_children_end_when_the_scenario_is_killed(file):
    process = start("scenario", str(file), "--duration", "0")
    until(lambda: started_by(process.pid))
    children = started_by(process.pid)
    time.sleep(1.5)
    process.kill()
    process.wait()
    try:
        until(lambda: not any(alive(child) for child in children), 10.0)
    finally:
        for child in filter(alive, children):
            os.kill(child, signal.SIGKILL)


def test_a_child_that_ignores_what_it_is_told_is_killed_in_the_end(monkeypatch):
    from haptic_teleop_control.nodes.launching import children

    monkeypatch.setattr(
        children, "STOPPING", ((signal.SIGINT, 0.2), (signal.SIGTERM, 0.2), (signal.SIGKILL, 5.0))
    )
    child = Child("composed", ["sfj_sim"])
    status = Path(f"/proc/{child.process.pid}/status")

    def catches_sigterm() -> bool:
        caught = next(line for line in status.read_text().splitlines() if line.startswith("SigCgt:"))
        return bool(int(caught.split()[1], 16) & 1 << signal.SIGTERM - 1)

    try:
        until(catches_sigterm)  # before that, the system itself would end it
        os.kill(child.process.pid, signal.SIGSTOP)  # now it can hear nothing
        assert stop_all([child]) == {"composed": 128 + signal.SIGKILL}
    finally:
        child.process.kill()


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("sfj_sim:\n", "sfj_smi:\n", "sfj_smi"),
        ("sfj_sim:\n  ros__parameters: {timeout", "sfj_sim:\n  ros__parameters: {tiemout", "tiemout"),
        ("duration: 1.5", "duration: .nan", "duration"),
        ("duration: 1.5", "durations: 1.5", "durations"),
        ("nodes: [sfj_sim,", "nodes: [sfj_smi,", "sfj_smi"),
        ("nodes: [sfj_sim,", "nodes: [omni_sim,", "twice"),
        ("rate: 200.0", "rate: fast", "rate"),
        ("[sfj_sim, omni_sim,", "[sfj_smi, omni_sim,", "nodes: sfj_smi is not a node; did you"),
        ("rate: 200.0", "rate: 200.0\n    joints: [omni_q, omni_z]", "set joints: ['omni_y', 'omni_z']"),
        ("rate: 200.0", "rate: 200.0\n    kind: effort", "set kind: position"),
        ("master_rate: 500.0", "master_rate: 1000.0", "make them equal"),
    ],
)
def test_a_mistake_anywhere_in_the_file_is_one_sentence_before_anything_starts(file, capsys, old, new, named):
    file.write_text(FILE.replace(old, new))
    assert main([str(file)]) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    assert named in error


def test_robots_do_not_engage_by_themselves(file, capsys, repository):
    text = (repository / "config" / "scenario1_real.yaml").read_text()
    text = text.replace("device: emulated", "device: hardware")
    file.write_text(re.sub(r"auto_engage: false.*", "", text))
    assert main([str(file)]) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1 and "set auto_engage: false, and use operate engage" in error


def test_a_real_time_factor_is_refused_where_time_is_the_walls(file, capsys):
    file.write_text(FILE.replace("use_sim_time: true", "realtime_priority: 0"))
    assert main([str(file), "--real-time-factor", "0"]) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1 and "runs by the wall" in error


def test_a_node_that_refuses_its_parameters_ends_the_scenario_with_2(file):
    file.write_text(FILE.replace("master_rate: 500.0", "master: sfj"))
    process = start("scenario", str(file))
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2, errors
    assert "master and slave are both sfj" in errors


def test_a_second_controller_in_the_same_domain_is_refused_before_anything_moves(file, graph, tmp_path):
    graph.probe.create_publisher(JointState, "/sfj/effort_command", LATEST_QOS)
    process = start("scenario", str(file), "--record", str(tmp_path / "bag"))
    graph.until(lambda: process.poll() is not None, 60.0)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2, errors
    assert "/sfj/effort_command is also published by /probe" in errors.splitlines()[-1]
    assert "stage 1:" not in errors
    assert not (tmp_path / "bag").exists()


@pytest.mark.long
@pytest.mark.parametrize("mode", [[], ["--processes"]])
def test_a_second_run_in_the_same_domain_is_refused_and_does_not_disturb_the_first(file, tmp_path, mode):
    """The nodes of both have the same names; while the second waits for its start it may answer nobody."""
    bag = tmp_path / "bag"
    # Slowly: it takes processor time as long as the second is refused.
    first = start("scenario", str(file), "--duration", "0", "--real-time-factor", "0.2", "--record", str(bag))
    second = None
    try:
        until(lambda: sum(path.stat().st_size for path in bag.glob("*.mcap")) > 300_000, 60.0)
        second = start("scenario", str(file), *mode)
        _, refusal = second.communicate(timeout=60)
        first.send_signal(signal.SIGINT)
        _, errors = first.communicate(timeout=30)
    finally:
        for process in filter(None, (first, second)):
            process.kill()
    assert second.returncode == 2, refusal
    # The graph may know a publisher before it knows its node's name.
    assert re.search(r"is also published by (another /|a node whose name)", refusal.splitlines()[-1])
    assert "ROS_DOMAIN_ID" in refusal.splitlines()[-1]
    assert "second_sender" not in errors
    recording = read_recording(bag)
    assert recording.complete
    for topic in ("/sfj/effort_command", "/omni/effort_command"):
        stamps = recording.topics[topic].stamp
        # The last zero bears the stamp of the last state, which was answered already.
        assert len(stamps) - len(set(stamps)) <= 1, f"{topic}: several answers to one state"


@pytest.mark.parametrize(
    ("file", "robot"), [("scenario1_sim", "sfj"), ("scenario2_real", "omni"), ("acquire_omni_y", "omni")]
)
def test_the_line_on_the_terminal_is_about_the_slave(repository, file, robot):
    assert load_scenario(repository / "config" / f"{file}.yaml").watched == robot


def test_a_fault_that_was_reset_leaves_the_line_and_stays_in_the_account():
    watcher = Watcher("omni")
    watcher._take(JointState(name=OMNI_JOINTS, position=[0.0] * 3, velocity=[0.0] * 3, effort=[0.0] * 3))
    for level, shown in ((DiagnosticStatus.ERROR, True), (DiagnosticStatus.OK, False)):
        status = DiagnosticStatus(level=level, name="/omni/omni_driver", message="late: it was late")
        watcher._diagnose(DiagnosticArray(status=[status]), {})
        assert ("FAULT in /omni/omni_driver" in watcher.line(0.0)) is shown
    assert watcher.faults == {"/omni/omni_driver": "late: it was late"}


def test_the_shipped_scenario_is_that_of_the_thesis(repository):
    scenario = load_scenario(repository / "config" / "scenario1_sim.yaml", {"record": "somewhere"})
    assert scenario.nodes == ("sfj_sim", "omni_sim", "force_controller", "signal_generator")
    assert scenario.record == "somewhere"
    with pytest.raises(ConfigurationError):
        load_scenario(repository / "config" / "scenario1_sim.yaml", {"duration": -1.0})


def test_its_processes_take_no_module_from_the_working_directory(tmp_path, monkeypatch):
    (tmp_path / "yaml.py").write_text("open('executed', 'w')\nraise SystemExit(3)\n")
    monkeypatch.chdir(tmp_path)
    child = Child("signal_generator", ["--help"])
    assert child.process.wait(30.0) == 0
    child.relay()
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize(
    ("status", "advice"), [(0, "recorded is closed"), (1, "recorded is closed"), (137, "recover")]
)
def test_a_recorder_that_ends_early_is_to_be_recovered_only_where_it_did_not_close_its_bag(status, advice):
    told = _ended_early([SimpleNamespace(name="recorder", status=status)])
    assert advice in told["recorder"] and f"exit status {status}" in told["recorder"]
