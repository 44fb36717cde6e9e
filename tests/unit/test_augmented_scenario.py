"""The scenario that a diagnosis hands on: the project's own, with the model in its simulated robot."""

import numpy as np
import pytest
from identification_plants import AXIS, STAGE
from stepped_machines import RIGID

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.lockstep import load_scenario, simulate_scenario
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.runs import augmented_scenario
from haptic_teleop_sysid.runs.augmented_scenario import write_scenario


def arm_at_the_end(folder, model):
    """Angle of stage 1's arm after 5 s, 1 s of which it is asked to move, rad."""
    model.save(folder / "augmented_model.yaml")
    path = write_scenario(folder, model, "augmented_model.yaml")
    topics = simulate_scenario(load_scenario(path), 5.0).topics
    return topics["/sfj/joint_states"].signal("stage1_arm", "position")[-1]


def test_the_scenario_runs_with_the_model_that_was_found(tmp_path):
    free = arm_at_the_end(tmp_path, STAGE)
    held = arm_at_the_end(
        tmp_path, STAGE.with_effects(Effect("coulomb_friction", "stage1_motor", {"torque": 50.0}))
    )
    assert free > 0.3 and abs(held) < 0.01


def test_a_stop_of_the_model_s_own_stands_in_place_of_the_wall(tmp_path):
    values = {"angle": 0.2, "stiffness": 2000.0}
    stopped = STAGE.with_effects(Effect("hard_stop", "stage1_arm", values))
    assert arm_at_the_end(tmp_path, stopped) == pytest.approx(0.2, abs=0.02)  # the wall stands at 1 rad
    assert "wall" not in (tmp_path / "scenario.yaml").read_text().split("stage1:")[1].split("stage2:")[0]


def test_an_axis_of_the_omni_takes_its_model_too(tmp_path):
    AXIS.save(tmp_path / "augmented_model.yaml")
    scenario = load_scenario(write_scenario(tmp_path, AXIS, "augmented_model.yaml"))
    topics = simulate_scenario(scenario, 1.0).topics
    assert np.all(np.isfinite(topics["/omni/joint_states"].position))


def test_another_machine_gets_none_and_an_earlier_file_goes(tmp_path, monkeypatch):
    (tmp_path / "scenario.yaml").write_text("stale")
    assert write_scenario(tmp_path, RIGID, "augmented_model.yaml") is None
    assert not (tmp_path / "scenario.yaml").exists()

    def absent(name):
        raise ConfigurationError(name)

    monkeypatch.setattr(augmented_scenario, "find_scenario", absent)
    assert write_scenario(tmp_path, STAGE, "augmented_model.yaml") is None
