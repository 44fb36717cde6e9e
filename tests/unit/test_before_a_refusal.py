"""What was odd about a log is said before what refuses it, and in the answer where it is the cause."""

from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.commands import diagnose, import_log
from haptic_teleop_sysid.diagnosis.evidence.proof import MODELS
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.story import reported, tell
from haptic_teleop_sysid.recordings.dataset import load_dataset
from haptic_teleop_sysid.recordings.time_grid import period_text
from haptic_teleop_sysid.runs import diagnosis_run
from haptic_teleop_sysid.simulation.windows import DEFAULT_SECONDS, cut

IO = {"topic": "/plant/joint_states", "joint": "joint"}


def model() -> Model:
    return Model(
        "generic",
        "joint",
        "rigid_body",
        {"torque_constant": 1.0, "motor_inertia": 0.01, "motor_damping": 0.05},
        io={"input": {**IO, "field": "effort"}, "motor": IO, "arm": None},
    )


def write_log(path, sign=1.0, seconds_per_row=0.002, seed=1):
    """A rigid body with damping, driven by two sines."""
    time = 0.002 * np.arange(2000)
    torque = 0.3 * np.sin(2 * np.pi * 1.1 * time + seed) + 0.2 * np.sin(2 * np.pi * 2.7 * time)
    speed, angle = np.zeros(len(time)), np.zeros(len(time))
    for k in range(len(time) - 1):
        speed[k + 1] = speed[k] + 0.002 * (torque[k] - 0.05 * speed[k]) / 0.01
        angle[k + 1] = angle[k] + 0.002 * speed[k + 1]
    rows = np.column_stack([seconds_per_row * np.arange(len(time)), sign * torque, angle])
    text = "time [s],torque [Nm],angle [rad]"
    np.savetxt(path, rows, delimiter=",", header=text, comments="", fmt="%.8g")
    return str(path)


@pytest.mark.parametrize(("seconds", "text"), [(2.0, "2 s"), (0.002, "2 ms"), (5e-5, "50 µs")])
def test_a_period_reads_in_the_unit_of_its_size(seconds, text):
    assert period_text(seconds) == text


def test_windows_that_nobody_asked_for_are_no_reason_to_ask_for_longer_ones(tmp_path):
    log = write_log(tmp_path / "slow.csv", seconds_per_row=2.0)
    data = load_dataset(open_recording(log), model(), log)
    with pytest.raises(ConfigurationError, match="2 s apart: is the time in another unit") as refused:
        cut(data, DEFAULT_SECONDS, "because the recording was made in closed loop")
    assert "--window" not in str(refused.value)
    with pytest.raises(ConfigurationError, match="give a longer --window"):
        cut(data, 1.0, "as asked")


def test_a_refusal_is_told_below_what_was_odd_about_the_recordings(capsys):
    def refuse(argv):
        with reported({"a.csv": ["its rows are 2 s apart"]}), reported({"a.csv": ["its rows are 2 s apart"]}):
            raise RecordingError("too slow.")

    assert run_command(refuse, []) == 2
    assert capsys.readouterr().err == "note: a.csv: its rows are 2 s apart\nerror: too slow.\n"


def test_diagnose_tells_of_the_unit_of_time_before_it_refuses(tmp_path, capsys):
    logs = [write_log(tmp_path / f"{n}.csv", seconds_per_row=2.0, seed=n) for n in (1, 2)]
    model().save(tmp_path / "model.yaml")
    arguments = ["--model", str(tmp_path / "model.yaml"), "--output", str(tmp_path / "out")]
    assert diagnose.main([*arguments, "--estimation", logs[0], "--validation", logs[1]]) == 2
    *before, last = capsys.readouterr().err.splitlines()
    assert last.startswith("error: ") and "--window" not in last
    assert any("is the time in another unit?" in line for line in before)


def test_an_input_that_brakes_in_every_recording_is_the_doubt(tmp_path):
    turned = [write_log(tmp_path / f"{n}.csv", sign=-1.0, seed=n) for n in (1, 2)]
    data = [load_dataset(open_recording(log), model(), log) for log in turned]
    followed = {model: {"estimation": {"j_motor.position": 80.0}} for model in MODELS}
    lost = {model: {"estimation": {"j_motor.position": -20.0}} for model in MODELS}
    told = {"verdict": "unknown", "findings": [], "doubt": "it has another size on the other recordings"}
    told |= {"fit": followed}
    doubt = diagnosis_run.with_input_sign(told, data)["doubt"]
    assert doubt.startswith("the input seems to have the opposite sign")
    assert f"haptic-teleop import {turned[0]} --suggest" in doubt
    assert diagnosis_run.with_input_sign(told | {"verdict": "identified"}, data)["doubt"] == told["doubt"]
    # A joint that falls over is braked by what holds it up: where that has a name, the sign is right.
    spring = {"effect": "spring_to_ground", "confidence": 0.44}
    for sure, others in ((0.69, []), (0.45, [spring])):
        gravity = {"effect": "gravity", "confidence": sure, "alternatives": others}
        held_up = told | {"findings": [gravity]}
        assert diagnosis_run.with_input_sign(held_up, data)["doubt"] == told["doubt"]
    # A name that is less likely than not does not say that the sign is right.
    delay = {"effect": "input_delay", "confidence": 0.27, "alternatives": []}
    late = told | {"findings": [delay]}
    assert diagnosis_run.with_input_sign(late, data)["doubt"] == doubt
    # Nor does one, or one of several, with which no model follows the motion any better than its mean.
    several = delay | {"alternatives": [{"effect": "sensor_delay", "confidence": 0.27}]}
    assert diagnosis_run.with_input_sign(told | {"findings": [several], "fit": lost}, data)["doubt"] == doubt
    right = write_log(tmp_path / "right.csv")
    data.append(load_dataset(open_recording(right), model(), right))
    assert diagnosis_run.with_input_sign(told, data) == told


def test_suggest_reverses_an_input_that_brakes_although_its_header_is_clear(tmp_path, capsys):
    log = write_log(tmp_path / "turned.csv", sign=-1.0)
    assert import_log.main([log, "--suggest"]) == 0
    said = capsys.readouterr()
    assert 'input: {column: "torque [Nm]", sign: -1}' in said.out
    assert "no mapping is needed" not in said.err
    (tmp_path / "mapping.yaml").write_text(said.out)
    assert not open_recording(log, tmp_path / "mapping.yaml").problems


def test_how_a_log_was_read_is_one_line_and_all_of_it_with_verbose(tmp_path, capsys):
    log = write_log(tmp_path / "log.csv")
    read = {log: open_recording(log).experiment}
    screen = Console(force_terminal=False, width=500)
    tell(screen, read)
    assert capsys.readouterr().out == f"{log}: read by its headers; -v tells how\n"
    tell(screen, read, verbose=True)
    assert "joint.input: column 'torque [Nm]' in Nm" in capsys.readouterr().out
    integrated = {**read[log]["import"], "changes": ["the position is the integral of the velocity"]}
    tell(screen, {log: {"import": integrated}})
    assert "is the integral" in capsys.readouterr().out, "what was done to it is always said"


def test_a_recording_has_nothing_to_tell_of_how_it_was_read(capsys):
    tell(Console(), {"bag": SimpleNamespace(experiment={}).experiment})
    assert not capsys.readouterr().out
