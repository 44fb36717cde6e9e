"""`haptic-teleop preview`: what a file commands, told and drawn, as the node would command it."""

from pathlib import Path

import matplotlib.image
import pytest

from haptic_teleop_control.preview_signal import command_of, main

CONFIG = Path(__file__).resolve().parents[2] / "config"


def write(folder: Path, text: str) -> Path:
    file = folder / "file.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def test_a_scenario_is_told_by_its_range_and_time_and_drawn_over_its_duration(tmp_path, capsys):
    picture = tmp_path / "look.png"
    assert main([str(CONFIG / "scenario1_sim.yaml"), "--output", str(picture)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "stage1: -0.06 to 0.06 rad, from 4 s without end (looked at up to 20 s)"
    assert lines[1] == "stage2: -0.08 to 0.08 rad, from 4 s without end (looked at up to 20 s)"
    assert lines[-1] == f"picture: {picture}"
    drawn = matplotlib.image.imread(picture)
    assert drawn.shape[1] > 800 and drawn.std() > 0.05


def test_an_acquisition_is_told_in_amperes_with_its_warnings(tmp_path, capsys):
    assert main([str(CONFIG / "acquire_sfj_stage1.yaml"), "--output", str(tmp_path / "p.svg")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("stage1: -0.3") and " A, from 1 s to 61 s" in lines[0]
    assert "above 0.1 A the response may be very quick" in lines[1]


def test_steps_without_end_are_drawn_to_a_little_beyond_the_last_one(tmp_path, capsys):
    assert main([str(CONFIG / "scenario1_real.yaml"), "--output", str(tmp_path / "p.png")]) == 0
    # The file's last step lies at 1 + 11 s.
    assert "(looked at up to 14.4 s)" in capsys.readouterr().out


def test_the_picture_is_of_the_steps_that_the_file_states():
    command, _ = command_of(CONFIG / "scenario1_sim.yaml")
    # The file's steps: 0.06 rad at 4 s, -0.06 at 14 s, 0 at 15 s.
    assert command.series([3.9, 4.1, 13.9, 14.1, 15.1])[:, 0] == pytest.approx([0.0, 0.06, 0.06, -0.06, 0.0])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("sfj_sim:\n  ros__parameters: {rate: 500.0}\n", "has no signal: give a scenario file"),
        ("signal_generator:\n  ros__parameters: {knd: effort}\n", "did you mean kind?"),
        ("acquisition:\n  ros__parameters: {joint: stage1}\n", "signal.enabled is false"),
    ],
)
def test_what_the_node_would_refuse_is_refused_in_a_sentence(tmp_path, capsys, text, told):
    assert main([str(write(tmp_path, text)), "--output", str(tmp_path / "p.png")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line
    assert not (tmp_path / "p.png").exists()


def test_a_place_that_is_no_picture_is_refused(tmp_path, capsys):
    assert main([str(CONFIG / "scenario1_sim.yaml"), "--output", str(tmp_path / "p.pdf")]) == 2
    assert "a preview is a .png or a .svg" in capsys.readouterr().err
