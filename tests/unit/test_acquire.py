"""An identification experiment moves one joint, stops at limits, warns and refuses, and ends in a bag that
says what it was."""

import numpy as np
import pytest
import yaml

from haptic_teleop_control.acquisition import ABORTED, FINISHED, Acquisition
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameter_files import parameters_for
from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.default_models import sfj_stage_model
from haptic_teleop_sysid.commands.acquire import experiment_from, main
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.recordings.preparation import Treatment, lead_in, prepare
from haptic_teleop_sysid.simulation.windows import closed_loop

SIGNAL = {
    "signal.enabled": True,
    "signal.delay": 0.5,
    "signal.duration": 2.0,
    "signal.square.enabled": True,
    "signal.square.period": 1.0,
}


def experiment(**changes):
    keys = {name.replace("__", "."): value for name, value in changes.items()}
    return Acquisition.from_parameters({**SIGNAL, "signal.square.amplitude": 0.05, **keys}, "file.yaml")


def config(tmp_path, repository, name, **signal):
    content = yaml.safe_load((repository / "config" / name).read_text())
    content["acquisition"]["ros__parameters"]["signal"] |= {"delay": 0.5, "duration": 2.0, **signal}
    path = tmp_path / name
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_stage_gets_its_current_and_the_other_nothing():
    one = experiment(joint="stage2")
    still = np.zeros(4)
    assert one.step(0.0, still, still).tolist() == [0.0, 0.0]
    # 0.05 A times the nominal 1.392 N·m/A of stage 2.
    assert one.step(0.6, still, still) == pytest.approx([0.0, 0.0696])
    assert one.step(1.1, still, still) == pytest.approx([0.0, -0.0696])
    assert one.step(2.6, still, still).tolist() == [0.0, 0.0]
    assert one.phase == FINISHED


def test_an_axis_follows_positions_from_where_it_stood_with_gain_1():
    one = experiment(joint="omni_y")
    home, speed = np.array([0.1, 0.3, 0.2]), np.zeros(3)
    assert one.step(0.0, home, speed).tolist() == [0.0, 0.0, 0.0]
    assert one.step(0.6, home + np.array([0.0, 0.02, 0.0]), speed) == pytest.approx([0.0, 0.05 - 0.02, 0.0])


@pytest.mark.parametrize(("position", "velocity", "what"), [
    ([1.3, 1.3, 0, 0], [0, 0, 0, 0], "position"),
    ([0.0, 0.0, 0, 0], [25.0, 0, 0, 0], "velocity"),
    ([0.3, -0.3, 0, 0], [0, 0, 0, 0], "deflection"),
    ([np.nan, 0.0, 0, 0], [0, 0, 0, 0], "position"),
])  # fmt: skip
def test_a_limit_aborts_for_good_and_is_named(position, velocity, what):
    one = experiment()
    one.step(0.0, [0.0] * 4, [0.0] * 4)
    assert one.step(0.7, position, velocity).tolist() == [0.0, 0.0]
    assert one.phase == ABORTED
    assert what in one.sentence
    assert one.step(0.8, [0.0] * 4, [0.0] * 4).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("joint", "careful"), [("stage1", 0.1), ("stage2", 0.2)])
def test_high_currents_warn_and_higher_ones_are_refused_without_allow(joint, careful):
    assert not experiment(joint=joint, signal__square__amplitude=careful - 0.01).warnings
    assert experiment(joint=joint, signal__square__amplitude=careful + 0.01).warnings
    with pytest.raises(ConfigurationError, match=r"0\.6 A of stage.*recommended 0\.5 A.*--allow"):
        experiment(joint=joint, signal__square__amplitude=0.6)
    assert experiment(joint=joint, signal__square__amplitude=0.6, allow=True).warnings


def test_the_file_for_the_robot_begins_emulated_and_with_a_current_that_needs_no_care(repository):
    experiment, sections = experiment_from(repository / "config" / "acquire_sfj_real.yaml")
    assert experiment.joint == "stage1" and not experiment.warnings
    assert parameters_for(sections, "sfj_driver")["device"] == "emulated"


def test_an_experiment_without_end_or_signal_is_refused():
    with pytest.raises(ConfigurationError, match=r"signal\.duration is unlimited"):
        Acquisition.from_parameters({**SIGNAL, "signal.duration": float("inf")}, "file.yaml")
    with pytest.raises(ConfigurationError, match=r"signal\.enabled is false"):
        Acquisition.from_parameters({**SIGNAL, "signal.enabled": False}, "file.yaml")


def test_the_bag_describes_itself_and_its_lead_in_is_found(tmp_path, repository):
    path = config(tmp_path, repository, "acquire_sfj_stage1.yaml")
    assert main(["--config", str(path), "--output", str(tmp_path / "bag"), "--lockstep"]) == 0
    recording = read_recording(tmp_path / "bag")
    assert recording.complete
    assert recording.parameters["/acquisition"]["joint"] == "stage1"
    assert set(recording.topics) == {"/sfj/joint_states", "/sfj/effort_command", "/reference"}
    states = recording.topic("/sfj/joint_states")
    assert np.ptp(states.signal("stage1_motor", "position")) > 0.01
    command = recording.topic("/sfj/effort_command")
    assert not np.any(command.signal("stage2_motor", "effort"))
    # The signal is a current; on the topic it is the torque at the joint, as everywhere.
    reference = recording.topic("/reference")
    assert reference.names == ("stage1_motor",) and reference.position is None
    np.testing.assert_allclose(
        reference.signal("stage1_motor", "effort"), command.signal("stage1_motor", "effort")
    )
    model = sfj_stage_model("stage1")
    dataset = load_dataset(recording, model, "bag")
    assert closed_loop(dataset) is False
    assert lead_in(dataset, recording) == 0.5
    treated, told = prepare(dataset, recording, model, Treatment())
    assert len(dataset) - len(treated) == 250
    assert any("lead-in of 0.5 s" in sentence for sentence in told)


def test_an_omni_bag_says_that_it_was_made_in_closed_loop(tmp_path, repository):
    path = config(tmp_path, repository, "acquire_omni_z.yaml")
    assert main(["--config", str(path), "--output", str(tmp_path / "bag"), "--lockstep"]) == 0
    recording = read_recording(tmp_path / "bag")
    assert "position loop" in recording.experiment["kind"]
    assert recording.topic("/reference").names == ("omni_z",)


def test_an_abort_ends_with_status_1_and_keeps_what_was_recorded(tmp_path, repository, capsys):
    path = config(tmp_path, repository, "acquire_omni_y.yaml", multisine={"enabled": True, "rms": 1.0})
    assert main(["--config", str(path), "--output", str(tmp_path / "bag"), "--lockstep"]) == 1
    assert "aborted" in capsys.readouterr().err
    efforts = read_recording(tmp_path / "bag").topic("/omni/effort_command").effort
    assert efforts is not None
    assert not np.any(efforts[-100:])


def test_mistakes_are_one_sentence_and_status_2(tmp_path, repository, capsys):
    path = config(tmp_path, repository, "acquire_sfj_stage1.yaml", step={"enabled": True, "amplitude": 0.7})
    assert main(["--config", str(path), "--output", str(tmp_path / "bag"), "--lockstep"]) == 2
    assert "--allow" in capsys.readouterr().err
    (tmp_path / "there").mkdir()
    good = config(tmp_path, repository, "acquire_sfj_stage2.yaml")
    assert main(["--config", str(good), "--output", str(tmp_path / "there"), "--lockstep"]) == 2
    assert "exists already" in capsys.readouterr().err
    other = repository / "config" / "scenario1_sim.yaml"
    assert main(["--config", str(other), "--output", str(tmp_path / "bag"), "--lockstep"]) == 2
    assert "no section acquisition" in capsys.readouterr().err
