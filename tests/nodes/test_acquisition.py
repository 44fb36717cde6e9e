"""`acquire` in a ROS graph: plant, experiment and recorder as processes, and a bag that `estimate` can
read."""

import subprocess
import sys

import numpy as np
import yaml

from haptic_teleop_control.recording import read_recording


def test_an_experiment_in_the_graph_moves_one_stage_and_ends_in_a_bag(tmp_path, repository):
    content = yaml.safe_load((repository / "config" / "acquire_sfj_stage2.yaml").read_text())
    content["acquisition"]["ros__parameters"]["signal"] |= {"delay": 0.5, "duration": 1.5}
    path, bag = tmp_path / "acquire.yaml", tmp_path / "bag"
    path.write_text(yaml.safe_dump(content))
    command = [sys.executable, "-m", "haptic_teleop_control.front_door", "acquire"]
    done = subprocess.run(
        [*command, "--config", str(path), "--output", str(bag)], capture_output=True, text=True, timeout=110
    )
    assert done.returncode == 0, done.stderr
    recording = read_recording(bag)
    assert recording.complete
    states = recording.topic("/sfj/joint_states")
    assert np.ptp(states.signal("stage2_motor", "position")) > 0.01
    commands = recording.topic("/sfj/effort_command")
    assert np.any(commands.signal("stage2_motor", "effort"))
    assert not np.any(commands.signal("stage1_motor", "effort"))
    # Every command answers a state, by its stamp.
    assert np.isin(commands.stamp, states.stamp).mean() > 0.95
    assert any(name.endswith("acquisition") for name in recording.parameters)
