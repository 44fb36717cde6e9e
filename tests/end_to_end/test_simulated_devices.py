"""Emulated and replayed devices, identification experiments and MuJoCo's plant keep simulated time, too."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from haptic_teleop_control.recording import read_recording

sys.path.insert(0, str(Path(__file__).parent))
from graph_runs import CONFIG, FRONT_DOOR, differences, scenario_command

pytestmark = pytest.mark.timeout(240)

REPLAY = """
/**:
  ros__parameters: {{use_sim_time: true}}
scenario:
  ros__parameters: {{nodes: [sfj_driver], duration: 2.0}}
sfj_driver:
  ros__parameters: {{device: replay, replay: {{file: {capture}}}}}
"""


def run(*command):
    result = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert result.returncode == 0, result.stderr


def through_the_drivers(folder, capture):
    """The scenario for the robots, on emulated devices, in simulated time and without an operator."""
    shutil.copytree(CONFIG, folder, dirs_exist_ok=True)
    content = (CONFIG / "scenario1_real.yaml").read_text()
    for old, new in (
        ("    device: emulated  ", "    use_sim_time: true\n    device: emulated  "),
        ("auto_engage: false", "auto_engage: true"),
        ("autostart: false", "autostart: true"),
        ("  ros__parameters:\n    rate: 500.0                    # Hz\n    timeout",
         f"  ros__parameters:\n    capture: {capture}\n    rate: 500.0\n    timeout"),
    ):  # fmt: skip
        assert old in content, old
        content = content.replace(old, new, 1)
    file = folder / "scenario.yaml"
    file.write_text(content)
    return file


@pytest.mark.long
def test_emulated_devices_give_the_same_in_one_process_and_in_many_and_replayed_once_more(tmp_path):
    file = through_the_drivers(tmp_path / "config", tmp_path / "sfj.raw")
    fast = ("--real-time-factor", "0", "--duration", "3")
    run(*scenario_command(file, tmp_path / "composed", *fast))
    composed = read_recording(tmp_path / "composed").topics
    assert np.abs(composed["/sfj/joint_states"].position).max() > 0.1

    replay = tmp_path / "replay.yaml"
    replay.write_text(REPLAY.format(capture=tmp_path / "sfj.raw"))
    run(*scenario_command(replay, tmp_path / "replayed", "--real-time-factor", "0"))
    replayed = read_recording(tmp_path / "replayed").topics["/sfj/joint_states"]
    original = composed["/sfj/joint_states"]
    assert len(replayed) == 1000
    for field in ("stamp", "position", "velocity", "effort"):
        assert np.array_equal(getattr(replayed, field), getattr(original, field)[:1000])

    (tmp_path / "sfj.raw").unlink()
    run(*scenario_command(file, tmp_path / "processes", *fast, "--processes"))
    assert differences(tmp_path / "processes", composed) == []


@pytest.mark.long
@pytest.mark.parametrize("plant", ["sfj_sim", "mujoco_sim"])
def test_an_identification_experiment_gives_the_same_in_the_graph_as_in_lockstep(tmp_path, plant):
    if plant == "mujoco_sim":
        pytest.importorskip("mujoco")
    content = (CONFIG / "acquire_sfj_stage1.yaml").read_text().replace("sfj_sim", plant)
    for old, new in (("duration: 60.0", "duration: 2.0"), ("period: 20.0", "period: 2.0"), ("0.1,", "0.5,")):
        assert old in content
        content = content.replace(old, new)
    file = tmp_path / "acquire.yaml"
    file.write_text(content)
    acquire = (*FRONT_DOOR, "acquire", "--config", str(file), "--output")
    run(*acquire, str(tmp_path / "graph"))
    run(*acquire, str(tmp_path / "lockstep"), "--lockstep")
    expected = read_recording(tmp_path / "lockstep").topics
    assert np.ptp(expected["/sfj/joint_states"].position) > 0.01
    assert differences(tmp_path / "graph", expected) == []
