"""The graph in simulated time is the lockstep runner: the same stamps and values, bit for bit, whatever the
machine does meanwhile."""

import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sysid.verification.clock import read_clock

sys.path.insert(0, str(Path(__file__).parent))
from graph_runs import CONFIG, differences, scenario_command, stop_now_and_then

MEANWHILE = pytest.mark.timeout(240)


def run(file, bag, duration, *options, stops=None):
    """Topics of lockstep after the graph has run; `stops` disturbs it. The run ends with 0."""
    command = scenario_command(file, bag, "--duration", str(duration), "--real-time-factor", "0", *options)
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        if stops is not None:
            stops(process)
        _, errors = process.communicate(timeout=200)
    assert process.returncode == 0, errors
    return run_scenario(file, duration)


def shortened(name, folder, *changes):
    """A scenario of the project in which the motion begins at once."""
    content = (CONFIG / name).read_text()
    for old, new in (
        ("delay: 4.0", "delay: 0.3"),
        ("times: [4.0, 4.6, 9.0, 9.6, 10.4, 10.8]", "times: [0.2, 0.6, 9.0, 9.6, 10.4, 10.8]"),
        ("times: [4.0, 4.6, 9.0, 9.6, 10.2, 10.6]", "times: [0.2, 0.6, 9.0, 9.6, 10.2, 10.6]"),
    ):
        content = content.replace(old, new)
    for old, new in changes:
        assert old in content, old
        content = content.replace(old, new)
    file = folder / name
    file.write_text(content)
    return file


@MEANWHILE
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("scenario1_sim.yaml", ()),  # in processes: below, where they are stopped now and then
        ("scenario2_sim.yaml", ()),
        pytest.param("scenario2_sim.yaml", ("--processes",), marks=pytest.mark.long),
        pytest.param("scenario1_link_sim.yaml", (), marks=pytest.mark.long),
        pytest.param("scenario1_link_sim.yaml", ("--processes",), marks=pytest.mark.long),
    ],
)
def test_stamps_and_values_of_the_graph_are_those_of_lockstep(tmp_path, name, options):
    expected = run(shortened(name, tmp_path), tmp_path / "bag", 2.0, *options)
    assert differences(tmp_path / "bag", expected) == []
    slave = "/omni" if name.startswith("scenario2") else "/sfj"
    assert np.abs(expected[f"{slave}/joint_states"].position).max() > 0.1  # it is about a robot that moves


@pytest.mark.long
@MEANWHILE
def test_rates_without_a_common_period_and_packets_repeated_and_overtaken_make_no_difference(tmp_path):
    file = shortened(
        "scenario1_link_sim.yaml",
        tmp_path,
        ("rate: 500.0                    # Hz", "rate: 400.0"),
        ("reorder: 0.0 ", "reorder: 0.1\n    duplicate: 0.1 "),
        ("    link: true", "    link: true\n    slave_rate: 400.0"),
        ("    rate: 500.0\n\nrecorder", "    rate: 300.0\n\nrecorder"),
    )
    expected = run(file, tmp_path / "bag", 2.0)
    assert differences(tmp_path / "bag", expected) == []


@pytest.mark.long
@MEANWHILE
@pytest.mark.parametrize("seed", [1, 2])
def test_a_process_that_is_stopped_for_up_to_1_5_s_now_and_then_makes_no_difference(tmp_path, seed):
    luck = random.Random(seed)
    expected = run(
        shortened("scenario1_sim.yaml", tmp_path), tmp_path / "bag", 1.5, "--processes",
        stops=lambda process: stop_now_and_then(process, luck, 0.0, 4.0),
    )  # fmt: skip
    assert differences(tmp_path / "bag", expected) == []


@pytest.mark.long
@MEANWHILE
def test_a_machine_that_freezes_as_a_whole_makes_no_difference(tmp_path):
    luck = random.Random(3)
    expected = run(
        shortened("scenario1_sim.yaml", tmp_path), tmp_path / "bag", 6.0,
        stops=lambda process: stop_now_and_then(process, luck, 0.3, 4.0),
    )  # fmt: skip
    assert differences(tmp_path / "bag", expected) == []


@pytest.mark.long
def test_the_recording_says_that_time_was_simulated_and_how_fast_it_ran(tmp_path):
    run(CONFIG / "scenario1_sim.yaml", tmp_path / "bag", 0.3)
    recording = read_recording(tmp_path / "bag")
    assert recording.parameters["/force_controller"]["use_sim_time"] is True
    assert recording.parameters["/time_coordinator"]["real_time_factor"] == 0.0
    *_, last = (one for one in recording.diagnostics if one.node == "/time_coordinator")
    assert last.values["simulated time (s)"] == "0.300"  # of the whole run, however short it was
    clock = read_clock(recording)
    assert clock.kind == "simulated" and clock.wanted == 0.0 and clock.achieved > 0.0
