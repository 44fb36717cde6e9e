"""A scenario whose nodes go by the machine's clock."""

import numpy as np
import pytest
from small_scenario import FILE, start

from haptic_teleop_control.recording import read_recording


@pytest.mark.long
@pytest.mark.wall_time
@pytest.mark.parametrize("mode", [[], ["--processes"]])
def test_by_the_wall_it_begins_together_moves_and_ends_with_zero(tmp_path, mode, stalls):
    """A machine that stands still for longer than a command holds ends it by a fault, and by nothing else."""
    file = tmp_path / "scenario.yaml"
    file.write_text(FILE.replace("use_sim_time: true", "realtime_priority: 20"))
    bag = tmp_path / "bag"
    process = start("scenario", str(file), "--record", str(bag), *mode)
    _, errors = process.communicate(timeout=60)
    faults = [line for line in errors.splitlines() if line.startswith("fault in")]
    assert process.returncode == (1 if faults else 0), errors
    assert all("stale" in fault or "robot_fault" in fault for fault in faults)
    assert not faults or stalls.excuse(0.05), errors
    recording = read_recording(bag)
    assert recording.complete
    effort = recording.topics["/sfj/effort_command"].effort
    assert not effort[-1].any()
    first = [topic.received[0] for topic in recording.topics.values()]
    assert max(first) - min(first) < 50_000_000 or stalls.excuse(0.05), "ns: nobody was late when it began"
    if not faults:
        assert abs(effort[:-5]).max() > 0.0
        assert np.ptp(recording.topics["/sfj/joint_states"].signal("stage1_arm", "position")) > 0.05
