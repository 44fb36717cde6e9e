"""Both scenarios, in simulation and through the drivers: the same executables, told apart by parameters."""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.lockstep import load_scenario, simulate_scenario

sys.path.insert(0, str(Path(__file__).parent))
from graph_runs import Supervisor, scenario_command

FRONT_DOOR = [sys.executable, "-m", "haptic_teleop_control.front_door"]
ARMS, AXES = [1, 3], [1, 2]
# Per scenario: the slave's states, the joints that touch, where the surface is, the desired torques, how far
# beyond the surface the joint may come, and what free motion should be, Td / lambda.
EXPECTED = {
    1: ("/sfj/joint_states", ARMS, 1.0, (0.6, 0.8), 0.01, (1.2, 1.6)),
    2: ("/omni/joint_states", AXES, 0.4, (0.1, 0.1), 0.005, (0.5, 0.5)),
}


@pytest.mark.parametrize("number", [1, 2])
def test_in_simulation_it_moves_freely_presses_and_lets_go(repository, number):
    result = simulate_scenario(load_scenario(repository / "config" / f"scenario{number}_sim.yaml"), 20.0)
    topic, joints, surface, torques, deep, speeds = EXPECTED[number]
    states = result.topics[topic]
    time_, position = states.time(), states.position[:, joints]
    assert [state for _, state in result.states] == ["devices_ready", "aligning", "engaged"]
    assert not any(name.startswith("fault") for name in result.counts)
    for i, (torque, speed) in enumerate(zip(torques, speeds, strict=True)):
        first = int(np.argmax(position[:, i] >= surface))
        assert first > 0
        span = (time_ > time_[first] - 0.06) & (time_ < time_[first] - 0.02)
        assert states.velocity[span, joints[i]].mean() == pytest.approx(speed, rel=0.15)
        assert surface < position[:, i].max() < surface + deep
        pressing = (time_ > 12.0) & (time_ < 13.9)
        if number == 1:  # the torque is measured
            assert states.effort[pressing, joints[i]].mean() == pytest.approx(torque, rel=0.02)
        else:  # the commanded torque presses, as far as friction lets it: 0.03 N·m
            commanded = result.topics["/omni/effort_command"].effort[pressing, joints[i]].mean()
            assert commanded == pytest.approx(torque, abs=0.03)
        assert position[-1, i] < surface - 0.05


def test_over_the_link_of_the_shipped_file_it_presses_and_stays_passive(repository):
    result = simulate_scenario(load_scenario(repository / "config" / "scenario1_link_sim.yaml"), 9.0)
    states = result.topics["/sfj/joint_states"]
    pressing = states.time() > 8.0
    assert np.all(states.effort[pressing][:, ARMS].mean(axis=0) > 0.4)
    assert np.all(states.effort[pressing][:, ARMS].std(axis=0) < 0.02)
    assert result.energies["lowest link"].min() > -2.5e-3
    assert result.energies["lowest master"].min() > -10e-3
    assert not result.counts


def operate(act: str) -> None:
    command = [*FRONT_DOOR, "operate", act, "--wait", "60"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.timeout(300)
@pytest.mark.long
@pytest.mark.parametrize("number", [1, 2])
def test_through_the_drivers_it_waits_for_the_operator_then_moves_and_presses(tmp_path, repository, number):
    """On emulated devices in simulated time, which the operator pauses to act: it moves by what was told and
    not by how fast this machine is."""
    for file in (repository / "config").glob("scenario*.yaml"):
        text = file.read_text(encoding="utf-8")
        simulated = text.replace("    device: emulated ", "    use_sim_time: true\n    device: emulated ")
        (tmp_path / file.name).write_text(simulated, encoding="utf-8")
    shutil.copytree(repository / "config" / "models", tmp_path / "models")
    bag = tmp_path / "bag"
    command = scenario_command(tmp_path / f"scenario{number}_real.yaml", bag, "--real-time-factor", "0")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        with Supervisor() as supervisor:
            supervisor.until(lambda: supervisor.states.get("/force_controller") == "devices_ready: aligned")
            supervisor.call("/time_coordinator/pause")
            before = supervisor.time
            for act in ("engage", "start"):
                operate(act)
            assert supervisor.time == before, "time stood still meanwhile"
            supervisor.call("/time_coordinator/resume")
            supervisor.until(lambda: supervisor.time > before + 4.0)
            supervisor.call("/time_coordinator/pause")  # or it runs on while a command starts
            operate("disengage")
            supervisor.call("/time_coordinator/resume")
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 0, errors
    recording = read_recording(bag)
    topic, joints, surface, _, deep, _ = EXPECTED[number]
    states = recording.topics[topic]
    position = states.position[:, joints]
    assert np.all(position.max(axis=0) > surface - 0.002)
    assert np.all(position.max(axis=0) < surface + deep)
    assert recording.parameters["/force_controller"]["auto_engage"] is False
