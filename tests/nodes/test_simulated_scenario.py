"""Simulated time from the command `scenario`: one sentence for what cannot be, and an end with 1 that names
who did not do his part."""

import os
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from haptic_teleop_control.nodes.scenario import main
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.simulated_time.stamps import LAST_WORD
from haptic_teleop_sim import lockstep

FILE = """
/**:
  ros__parameters: {use_sim_time: true}
scenario:
  ros__parameters:
    nodes: [sfj_sim, omni_sim, force_controller, signal_generator]
    duration: 600.0
    real_time_factor: 0.0
omni_sim:
  ros__parameters: {rate: 500.0}
force_controller:
  ros__parameters: {master_rate: 500.0, law: "hanging:Hanging"}
signal_generator:
  ros__parameters:
    stage1: {enabled: true, step: {enabled: true, amplitude: 0.05}}
"""

LAW = """
import time
from haptic_teleop_control.laws import AugmentedErrorLaw

class Hanging(AugmentedErrorLaw):
    samples = 0

    def step(self, *arguments):
        self.samples += 1
        if self.samples > 100:
            time.sleep(600.0)
        return super().step(*arguments)
"""
"""A law that does not return any more."""

MOVES = r"stage 1: \S+ rad [+-](?!0\.000 )"
"""What the line on the terminal says where stage 1 has torque."""

FRONT_DOOR = [sys.executable, "-m", "haptic_teleop_control.front_door"]


@pytest.fixture
def file(tmp_path, monkeypatch) -> Path:
    (tmp_path / "hanging.py").write_text(LAW)
    path = tmp_path / "scenario.yaml"
    path.write_text(FILE)
    monkeypatch.chdir(tmp_path)
    return path


def usual(file: Path) -> Path:
    """With the thesis' law, which returns."""
    file.write_text(file.read_text().replace('law: "hanging:Hanging"', "law: augmented_error"))
    return file


def start(file: Path, *options: str) -> subprocess.Popen:
    return subprocess.Popen([*FRONT_DOOR, "scenario", str(file), *options], stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("real_time_factor: 0.0", "real_time_factor: -1.0", "real_time_factor"),
        ("real_time_factor: 0.0", "real_time_factor: .nan", "real_time_factor"),
        ("real_time_factor: 0.0", "real_time_factor: .inf", "real_time_factor"),
        ("{rate: 500.0}", "{rate: 500.0, use_sim_time: false}", "omni_sim does not; set use_sim_time alike"),
        (
            "omni_sim:\n",
            "recorder:\n  ros__parameters: {use_sim_time: false}\nomni_sim:\n",
            "the scenario runs in simulated time and recorder does not; set use_sim_time alike",
        ),
        ("[sfj_sim,", "[sfj_driver,", "device hardware is hardware, whose time nobody can hold"),
    ],
)
def test_what_cannot_be_in_a_file_is_one_sentence_and_status_2(file, capsys, old, new, told):
    usual(file).write_text(file.read_text().replace(old, new))
    assert main([str(file)]) == 2
    error = capsys.readouterr().err.strip()
    assert len(error.splitlines()) == 1
    assert told in error and str(file) in error


def test_lockstep_refuses_mixed_times_like_the_graph(file, capsys):
    usual(file).write_text(file.read_text().replace("{rate: 500.0}", "{rate: 500.0, use_sim_time: false}"))
    assert lockstep.main([str(file), "--duration", "1"]) == 2
    assert "omni_sim does not; set use_sim_time alike" in capsys.readouterr().err


@pytest.mark.parametrize("factor", ["-1", "nan", "inf", ".inf", "-.inf"])
def test_a_real_time_factor_that_is_none_is_refused_on_the_command_line(file, capsys, factor):
    assert main([str(usual(file)), f"--real-time-factor={factor}"]) == 2
    error = capsys.readouterr().err.strip()
    assert "real_time_factor" in error and len(error.splitlines()) == 1


@pytest.mark.long
def test_a_controller_that_never_answers_ends_the_scenario_with_1_and_is_named(file):
    process = start(file, "--processes")
    _, errors = process.communicate(timeout=100)
    assert process.returncode == 1, errors
    last = [line for line in errors.splitlines() if line.startswith("fault in")]
    assert any("/force_controller owes the answer to the state on" in line for line in last), errors


def test_a_law_that_does_not_return_ends_a_scenario_of_one_process_too(file):
    process = start(file)
    _, errors = process.communicate(timeout=100)
    assert process.returncode == 1, errors
    assert "the coordinator of simulated time has been silent for" in errors
    assert "a node in it that does not return" in errors


def until_it_runs(process: subprocess.Popen, says: str = "stage 1:") -> list[str]:
    """The lines that it has said until its states came, or what a pattern asks for."""
    lines, end = [], time.monotonic() + 60.0
    while not any(re.search(says, line) for line in lines):
        assert time.monotonic() < end
        lines.append(process.stderr.readline())
        assert lines[-1], "".join(lines)
    return lines


def stray(node: str, *arguments: str) -> subprocess.Popen:
    """A node that nobody of a scenario knows."""
    return subprocess.Popen([*FRONT_DOOR, node, *arguments], stderr=subprocess.PIPE, text=True)


def ends_first(processes: list[subprocess.Popen]) -> int:
    """Which of them ends before the others do."""
    watched = [os.pidfd_open(process.pid) for process in processes]
    try:
        ended, _, _ = select.select(watched, [], [], 100.0)
    finally:
        for one in watched:
            os.close(one)
    assert ended, "none has ended"
    return watched.index(ended[0])


@pytest.mark.long
@pytest.mark.parametrize("options", [(), ("--processes",)])
def test_a_second_run_and_a_stray_node_are_refused_and_the_first_run_goes_on(file, options):
    usual(file)
    # Slowly: it takes processor time as long as the others are refused.
    first = start(file, *options, "--real-time-factor", "0.1", "--record", "first")
    running = [first]
    try:
        until_it_runs(first)
        second = start(file, *options)
        running.append(second)
        _, refusal = second.communicate(timeout=100)
        assert second.returncode == 2 and "is also published by" in refusal, refusal
        nodes = ("signal_generator", "force_controller", "sfj_sim", "omni_sim")
        strays = [stray(node, "--ros-args", "-p", "use_sim_time:=true") for node in nodes]
        running += strays
        for node, process in zip(nodes, strays, strict=True):
            _, told = process.communicate(timeout=60)
            assert process.returncode == 2, told
            assert "another node of this name takes part" in told
            assert "FAULT" not in told, f"{node} has heard the first run"
        # Not beside the strays: one that begins before it hears of the first takes them along.
        another = stray("time_coordinator")
        running.append(another)
        assert "another coordinator of simulated time" in another.communicate(timeout=60)[1]
        assert another.returncode == 2 and first.poll() is None, "ended by one of them"
        by_the_wall = [stray(node) for node in ("sfj_sim", "force_controller")]  # they do not know of the run
        running += by_the_wall
        with pytest.raises(subprocess.TimeoutExpired):
            first.wait(timeout=8)
        for process in by_the_wall:
            assert process.poll() is None, process.communicate()[1]
        first.send_signal(signal.SIGINT)
        _, errors = first.communicate(timeout=60)
    finally:
        for process in running:
            process.kill()
            process.wait()
    assert first.returncode == 0 and "fault" not in errors, errors
    topics = read_recording(file.parent / "first").topics
    for robot in ("sfj", "omni"):  # 500 Hz
        states, commands = (topics[f"/{robot}/{name}"].stamp for name in ("joint_states", "effort_command"))
        assert np.all(np.diff(states) == 2_000_000), "no stray ones, none missing"
        assert 0 <= len(states) - len(commands) <= 1, "Ctrl-C may come before the last answer"
        assert np.array_equal(states[: len(commands)], commands)


@pytest.mark.long
def test_of_two_scenarios_started_together_one_goes_on(file):
    usual(file)
    # Both would go on for longer than anybody waits: one that has ended by itself is no stranger any more.
    both = [start(file), start(file)]
    try:
        refused, other = both if ends_first(both) == 0 else both[::-1]
        told = refused.communicate()[1]
        until_it_runs(other, says=MOVES)
        other.send_signal(signal.SIGINT)
        rest = other.communicate(timeout=60)[1]
    finally:
        for process in both:
            process.kill()
            process.wait()
    assert (refused.returncode, other.returncode) == (2, 0), (told, rest)
    assert "of a run begun before: stop that, or choose another ROS_DOMAIN_ID" in told


@pytest.mark.long
def test_a_coordinator_that_is_killed_ends_the_scenario_with_1_and_is_named(file):
    process = start(usual(file), "--processes", "--record", "bag")
    try:
        coordinator = None
        # How much simulated time passes until the first line depends on the machine.
        until_it_runs(process, says=MOVES)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
        for child in map(int, children):
            if b"time_coordinator" in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0"):
                coordinator = child
        assert coordinator is not None
        os.kill(coordinator, signal.SIGKILL)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 1, errors
    assert "time_coordinator ended with exit status 137" in errors
    topics = read_recording(file.parent / "bag").topics
    for robot in ("sfj", "omni"):
        states, commands = (topics[f"/{robot}/{name}"] for name in ("joint_states", "effort_command"))
        assert not np.any(commands.effort[-1]), "the last command is zero"
        assert commands.stamp[-1] == commands.stamp[-2] + LAST_WORD
        # Killed within a tick, the plant has made one step more than the controller has seen, and no second.
        assert commands.stamp[-1] - LAST_WORD in states.stamp[-2:]
    # A state that was seen and had no answer yet gets zero, too: only that one.
    assert np.any(topics["/sfj/effort_command"].effort[-3:-1]), "which none before it was"
