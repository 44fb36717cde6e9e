"""Stiffness from hung weights and drive against joint encoder: made tables whose answers are known."""

import json

import numpy as np
import pytest
from scipy.stats import linregress

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.commands.encoders import check_encoders
from haptic_teleop_sysid.commands.encoders import main as encoders_main
from haptic_teleop_sysid.commands.stiffness import joint_stiffness
from haptic_teleop_sysid.commands.stiffness import main as stiffness_main

TORQUE = np.array([0.1, 0.2, 0.3, 0.4, 0.5])


def test_exact_table_gives_the_spring_and_its_offset():
    found = joint_stiffness(TORQUE, (TORQUE - 0.02) / 3.971)
    assert found.value == pytest.approx(3.971)
    assert found.offset == pytest.approx(0.02)
    assert found.std < 1e-9


def test_standard_error_is_that_of_a_straight_line():
    deflection = TORQUE / 3.9 + np.random.default_rng(1).normal(0.0, 5e-4, 5)
    found, other = joint_stiffness(TORQUE, deflection), linregress(deflection, TORQUE)
    assert found.value == pytest.approx(other.slope)
    assert found.std == pytest.approx(other.stderr)
    # Three degrees of freedom: 3.182 standard errors.
    assert found.interval[1] - found.value == pytest.approx(3.182 * found.std, rel=1e-3)


def test_a_misread_row_is_named(tmp_path, capsys):
    torque = np.linspace(0.05, 0.6, 12)
    deflection = np.degrees(torque / 3.9)
    deflection[7] += 0.5
    rows = "\n".join(f"{t:.4f}, {d:.4f}" for t, d in zip(torque, deflection, strict=True))
    path = tmp_path / "weights.csv"
    path.write_text(f"# stage 2, lightest spring\ntorque, deflection\n{rows}\n")
    output = tmp_path / "ks.json"
    assert stiffness_main([str(path), "--degrees", "--stage", "stage2", "--output", str(output)]) == 0
    told = capsys.readouterr().out
    assert "row 8" in told and "stage2 is configured with 3.891" in told
    assert json.loads(output.read_text())["value"] == pytest.approx(3.9, rel=0.05)


def test_the_same_table_as_yaml(tmp_path, capsys):
    path = tmp_path / "weights.yaml"
    path.write_text("torque: [0.1, 0.2, 0.3]\ndeflection: [0.025, 0.05, 0.075]\n")
    assert stiffness_main([str(path)]) == 0
    assert "Ks = 4.0000" in capsys.readouterr().out


@pytest.mark.parametrize(("text", "sentence"), [
    ("torque,deflection\n0.1,0.02\n0.2,0.04\n", "2 rows, and at least 3"),
    ("torque,angle\n0.1,0.02\n0.2,0.04\n0.3,1\n", "no column 'deflection'"),
    ("torque,deflection\n0.1,x\n0.2,0.04\n0.3,1\n", "row 1: deflection is 'x'"),
    ("torque,deflection\n0.1,-0.02\n0.2,-0.04\n0.3,-0.06\n", "check the signs"),
    ("torque,deflection\n0.1,0.02\n0.2,0.02\n0.3,0.02\n", "different deflections"),
])  # fmt: skip
def test_a_table_that_gives_nothing_is_one_sentence(tmp_path, capsys, text, sentence):
    path = tmp_path / "weights.csv"
    path.write_text(text)
    assert stiffness_main([str(path)]) == 2
    assert sentence in " ".join(capsys.readouterr().err.split())


def test_gearing_that_is_off_is_found_and_what_it_would_leave():
    drive = np.linspace(-1.4, 1.4, 200)
    found = check_encoders(drive, 1.004 * drive + 0.01, gearing=6.23)
    assert found.scale == pytest.approx(1.004)
    assert found.gearing == pytest.approx(6.23 * 1.004)
    assert found.error == pytest.approx(0.004 * 1.4)
    assert found.remaining < 1e-12
    with pytest.raises(ConfigurationError, match=r"less than 0\.1 rad"):
        check_encoders([0.0, 0.01, 0.02], [0.0, 0.01, 0.02])


def test_the_calibration_of_0_2_degrees_is_judged(tmp_path, capsys):
    path = tmp_path / "angles.csv"
    degrees = np.linspace(-80.0, 80.0, 9)
    for error, said in ((0.1, "are kept"), (0.5, "are not kept")):
        rows = "\n".join(f"{d},{d * (1 + error / 80.0)}" for d in degrees)
        path.write_text(f"drive,joint\n{rows}\n")
        assert encoders_main(["--table", str(path), "--degrees"]) == 0
        assert said in capsys.readouterr().out
