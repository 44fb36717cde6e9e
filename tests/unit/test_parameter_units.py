"""Parameters are told in the units of the machine that was recorded, which need not turn, nor be driven by
torque."""

import json

import pytest
from joint_logs import DAMPING, INERTIA, machine, table

from haptic_teleop_sim.effects import registry
from haptic_teleop_sim.model import PARAMETER_UNITS
from haptic_teleop_sysid.commands import estimate
from haptic_teleop_sysid.commands.model_from_log import main as model_main
from haptic_teleop_sysid.recordings.parameter_units import Units


@pytest.mark.parametrize(
    ("header", "scale", "units"),
    [
        (("time [s]", "force [N]", "x [mm]"), 1e3, ("1", "kg", "N*s/m")),
        (("time [s]", "current [A]", "q [rad]"), 1.0, ("1", "A*s^2/rad", "A*s/rad")),
        (("time [s]", "torque [Nm]", "q [rad]"), 1.0, ("1", "kg*m^2", "N*m*s/rad")),
    ],
)
def test_estimate_tells_the_parameters_of_an_axis_in_its_units(tmp_path, capsys, header, scale, units):
    t, force, way, _ = machine()
    log, model = table(tmp_path / "log.csv", header, (t, force, scale * way)), tmp_path / "model.yaml"
    assert model_main(["--from", str(log), "--output", str(model)]) == 0
    argv = ["--model", str(model), "--bag", str(log), "--output", str(tmp_path / "out")]
    assert estimate.main(argv) == 0
    rows = json.loads((tmp_path / "out" / "estimate.json").read_text())["parameters"]
    assert [row["name"] for row in rows] == ["torque_constant", "motor_inertia", "motor_damping"]
    assert tuple(row["unit"] for row in rows) == units
    assert [row["value"] for row in rows[1:]] == pytest.approx([INERTIA, DAMPING], rel=0.02)
    shown = units[1].replace("*", "·").replace("^2", "²")  # as a reader writes it
    assert shown in capsys.readouterr().out
    assert f">{shown}<" in (tmp_path / "out" / "report.html").read_text()


#: What each unit of a turning joint is on a linear axis, by hand.
LINEAR = {
    "N*m": "N", "N*m/rad": "N/m", "N*m/rad^3": "N/m^3", "N*m*s/rad": "N*s/m", "kg*m^2": "kg", "rad": "m",
    "rad/s": "m/s", "s/rad": "s/m", "N*m*s^2/rad^2": "N*s^2/m^2", "N*m*s^3/rad^3": "N*s^3/m^3",
}  # fmt: skip


def test_no_unit_of_a_parameter_is_forgotten():
    every = {p.unit for entry in registry.EFFECTS.values() for p in entry.parameters}
    every |= set(PARAMETER_UNITS.values())
    for unit in every:
        found = Units("m", "N").restated(unit)
        assert found == LINEAR.get(unit, unit), unit
        assert unit in LINEAR or ("rad" not in unit and ("N*m" not in unit or unit == "N*m/A"))
        assert Units().restated(unit) == unit


def test_a_suggested_law_has_the_units_of_the_machine():
    said = "it may be torque = -0.18 * velocity (N*m, rad, rad/s), which explains 98 %"
    assert "(A, rad, rad/s)" in Units("rad", "A").restated_all(said)
    assert "(N, m, m/s)" in Units("m", "N").restated_all(said) and Units().restated_all(said) == said
    assert Units("rad", "A").restated("N*m/(rad/s)") == "A/(rad/s)"


def test_the_units_of_a_diagnosis_are_those_of_the_axis():
    content = {
        "findings": [{"parameters": {"torque": {"value": 20.4, "unit": "N*m"}}, "because": "it is 20.4 N*m"}],
        "recordings": {"rad": ["moves 3 rad in /tmp/1 rad.csv"]},
        "moved": [{"unit": "kg*m^2"}],
    }
    found = Units("m", "N").restated_all(content)
    assert found["findings"][0]["parameters"]["torque"] == {"value": 20.4, "unit": "N"}
    assert found["findings"][0]["because"] == "it is 20.4 N" and found["moved"][0]["unit"] == "kg"
    assert Units().restated_all(content) == content
