"""What a proposal makes of columns that names leave open: values decide, and the file tells what is open."""

from datetime import UTC, datetime

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from joint_logs import machine, plain_table, table

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.strict_yaml import parse_yaml
from haptic_teleop_sysid.commands.import_log import main
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.units import unit_of

T, TORQUE, ANGLE, SPEED = machine()
STATES = "/plant/joint_states"
RPM = 30.0 / np.pi


def suggested(log, tmp_path, capsys):
    """(mapping as text, what was said) of a proposal."""
    capsys.readouterr()
    assert main([str(log), "--suggest"]) == 0
    captured = capsys.readouterr()
    (tmp_path / "suggested.yaml").write_text(captured.out)
    return captured.out, captured.err


def with_text(path, column):
    """The table with a word in a cell of a column, from 0."""
    lines = path.read_text().splitlines()
    cells = lines[40].split(",")
    cells[column] = "OVERLOAD"
    lines[40] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    return path


HEADER = ("time [s]", "torque [Nm]", "motor [deg]", "link [deg]")
COLUMNS = (T, TORQUE, np.degrees(ANGLE), np.degrees(0.9 * ANGLE))


def line_of(out, key):
    return next(line for line in out.splitlines() if line.strip().startswith(key))


def test_an_arm_is_not_taken_for_a_motor_whose_own_column_holds_text(tmp_path, capsys):
    log = with_text(table(tmp_path / "log.csv", HEADER, COLUMNS), 2)
    out, _ = suggested(log, tmp_path, capsys)
    motor, arm = [line.strip() for line in out.splitlines() if line.strip().startswith("position:")]
    assert motor == "position: {column: FILL IN}  # missing: 'motor [deg]' holds text"
    assert arm.startswith('position: {column: "link [deg]"}')


def test_an_arm_is_not_taken_for_a_motor_whose_own_column_is_empty(tmp_path, capsys):
    empty = np.full(len(T), np.nan)
    log = table(tmp_path / "log.csv", HEADER, (T, TORQUE, empty, COLUMNS[3]))
    assert main([str(log), "--suggest"]) == 2
    said = capsys.readouterr()
    assert "position: {column: FILL IN}  # missing: 'motor [deg]' holds no number" in said.out
    assert "error" in said.err
    told = "'motor.*' holds no number.*record it; if 'link.*only encoder, give it in a mapping as the motor's"
    with pytest.raises(ConfigurationError, match=told):
        open_recording(log)
    # One encoder, whatever it is called, is the joint's.
    header, columns = (HEADER[0], HEADER[1], HEADER[3]), (T, TORQUE, COLUMNS[3])
    assert open_recording(table(tmp_path / "one.csv", header, columns)).topics[STATES].names == ("joint",)


@pytest.mark.parametrize(("more", "lacks"), [((), True), (("torque [Nm]",), True), (("foo",), False)])
def test_a_log_without_an_input_is_not_to_be_mended_by_a_mapping(tmp_path, capsys, more, lacks):
    columns = (T, ANGLE, SPEED, *((np.full(len(T), np.nan) if "torque" in n else TORQUE) for n in more))
    log = table(tmp_path / "log.csv", ("time [s]", "angle [rad]", "speed [rad/s]", *more), columns)
    assert main([str(log), "--suggest"]) == (2 if lacks else 0)
    assert ("record it" in capsys.readouterr().err) == lacks
    with pytest.raises(ConfigurationError) as refused:
        open_recording(log)
    assert ("there is no column that could be the input" in str(refused.value)) == lacks
    assert ("mapping" in str(refused.value)) != lacks, "which helps where a column may be it"


def test_columns_that_may_drive_are_offered_where_none_is_an_input_by_its_name(tmp_path, capsys):
    header = ("time [s]", "leftSpeed [rad/s]", "leftCommand", "rightCommand")
    log = table(tmp_path / "log.csv", header, (T, SPEED, TORQUE, TORQUE))
    assert main([str(log), "--suggest"]) == 2
    told = capsys.readouterr().err
    assert "if 'leftCommand' or 'rightCommand' drives the joint, give it in a mapping" in told


@pytest.mark.parametrize("lost", [1, 0])
def test_an_input_and_a_time_that_are_left_over_are_guesses(tmp_path, capsys, lost):
    header = ("t [s]", "torque [Nm]", "clock [ms]", "current [A]", "q [deg]")
    columns = (T, TORQUE, 1e3 * T, TORQUE, COLUMNS[2])
    log = with_text(table(tmp_path / "log.csv", header, columns), lost)
    out, _ = suggested(log, tmp_path, capsys)
    assert "# guessed" in line_of(out, "input:" if lost else "time:")
    assert "taken because" in line_of(out, "input:" if lost else "time:")


def test_what_is_open_stands_in_the_file_at_its_line(tmp_path, capsys):
    header = ("time [s]", "torque [Nm]", "current [A]", "q [deg]", "note: #1")
    log = with_text(table(tmp_path / "log.csv", header, (T, TORQUE, TORQUE, COLUMNS[2], T)), 2)
    out, said = suggested(log, tmp_path, capsys)
    lines = out.splitlines()
    for told in [line.partition("open: ")[2] for line in said.splitlines() if line.startswith("open: ")]:
        assert sum(told in line and line.lstrip().startswith("#") for line in lines) == 1, told
    for told in [line.partition("note: ")[2] for line in said.splitlines() if line.startswith("note: ")]:
        assert f"# note: {told}" in lines
    place = lines.index('#   "current [A]"')
    assert lines[place + 1].startswith("#   # open: 'current [A]' holds text, first 'OVERLOAD' in line 41")
    two = table(tmp_path / "two.csv", (*header[:4], "u [V]"), (T, TORQUE, TORQUE, COLUMNS[2], TORQUE))
    lines = suggested(two, tmp_path, capsys)[0].splitlines()
    entry = next(i for i, line in enumerate(lines) if line.startswith("    input:"))
    assert "may be the input as well as 'torque [Nm]'" in lines[entry - 1]
    assert parse_yaml("\n".join(lines))["joints"]["joint"]["input"] == {"column": "torque [Nm]"}


@pytest.mark.parametrize("name", ["spd", "x3", "foo"])
@pytest.mark.parametrize(("scale", "unit"), [(RPM, "rpm"), (-180.0 / np.pi, "deg/s")])
def test_a_velocity_is_found_whatever_its_name_says_and_its_unit_with_it(
    tmp_path, capsys, name, scale, unit
):
    noise = np.random.default_rng(1).normal(size=len(T))
    header = ("time [s]", name, "noise", "torque [Nm]", "angle [deg]")
    log = table(tmp_path / "log.csv", header, (T, scale * SPEED, noise, TORQUE, np.degrees(ANGLE)))
    out, _ = suggested(log, tmp_path, capsys)
    assert f"unit: {unit}" in line_of(out, "velocity:") and "# likely" in line_of(out, "velocity:")
    assert list(parse_yaml(out)["joints"]) == ["joint"] and "#   noise" in out
    states = open_recording(log, tmp_path / "suggested.yaml").topics[STATES]
    assert np.allclose(states.signal("joint", "velocity"), SPEED, atol=1e-6)


def test_a_position_is_found_by_the_velocity_that_is_its_derivative(tmp_path, capsys):
    log = table(tmp_path / "log.csv", ("time [s]", "bar", "torque [Nm]", "speed"), (T, ANGLE, TORQUE, SPEED))
    out, _ = suggested(log, tmp_path, capsys)
    assert "{column: bar, unit: rad}  # likely: motor position by its values" in out


def test_motor_and_arm_each_get_their_own_velocity(tmp_path, capsys):
    longer = machine(2000)
    (_, motor, speed), (_, arm, arm_speed) = ([c[k : k + 1500] for c in longer[1:]] for k in (0, 3))
    header = ("time [s]", "torque [Nm]", "motor [deg]", "link [deg]", "b", "a")
    columns = (T, TORQUE, np.degrees(motor), np.degrees(0.8 * arm), 0.8 * arm_speed, np.degrees(speed))
    mapped = parse_yaml(suggested(table(tmp_path / "log.csv", header, columns), tmp_path, capsys)[0])
    joint = mapped["joints"]["joint"]
    assert joint["motor"]["velocity"] == {"column": "a", "unit": "deg/s"}
    assert joint["arm"]["velocity"] == {"column": "b", "unit": "rad/s"}


def test_what_goes_together_by_no_factor_between_units_is_told_and_left_out(tmp_path, capsys):
    header = ("time [s]", "torque [Nm]", "angle [rad]", "foo")
    log = table(tmp_path / "log.csv", header, (T, TORQUE, ANGLE, 0.123 * SPEED))
    out, _ = suggested(log, tmp_path, capsys)
    assert "velocity:" not in out
    assert "'foo' goes with the derivative of 'angle [rad]'" in out and "factor of 8.13" in out
    # Where headers say all, a column that is not needed leaves nothing open.
    assert open_recording(log).topics[STATES].names == ("joint",)


def test_what_its_name_says_is_something_else_is_no_velocity(tmp_path, capsys):
    header = ("time [s]", "torque [Nm]", "angle [deg]", "velocity_error", "dq_ref", "temp [degC]")
    columns = (T, TORQUE, np.degrees(ANGLE), SPEED, SPEED, SPEED)
    out, _ = suggested(table(tmp_path / "log.csv", header, columns), tmp_path, capsys)
    assert "velocity:" not in out


def test_a_joint_that_nothing_names_is_told(tmp_path, capsys):
    header = ("time [s]", "torque [Nm]", "motor [deg]", "foo", "bar")
    arm, arm_speed = 0.7 * np.degrees(ANGLE), 0.7 * np.degrees(SPEED)
    out, _ = suggested(
        table(tmp_path / "log.csv", header, (T, TORQUE, COLUMNS[2], arm, arm_speed)), tmp_path, capsys
    )
    assert "go along with 'motor [deg]': the arm's?" in out


def test_a_log_that_says_all_is_proposed_without_anything_open(tmp_path, capsys):
    out, said = suggested(plain_table(tmp_path / "log.csv"), tmp_path, capsys)
    assert "open:" not in out and "nothing is open" in said


def test_numbers_behind_a_letter_name_no_joints_where_one_is_the_derivative_of_another(tmp_path, capsys):
    noise = np.random.default_rng(2).normal(size=len(T))
    log = table(tmp_path / "log.csv", ("t", "u", "x1", "x2", "x3"), (T, TORQUE, ANGLE, SPEED, noise))
    mapped = parse_yaml(suggested(log, tmp_path, capsys)[0])["joints"]
    assert list(mapped) == ["joint"] and mapped["joint"]["input"]["column"] == "u"
    assert mapped["joint"]["motor"]["velocity"] == {"column": "x2", "unit": "rad/s"}
    # Otherwise they do: q1 and q2 are of two joints.
    header = ("t", "tau1", "tau2", "q1", "q2", "dq1", "dq2")
    later = machine(2000)[2][500:2000]
    columns = (T, TORQUE, TORQUE, ANGLE, later, SPEED, machine(2000)[3][500:2000])
    mapped = parse_yaml(suggested(table(tmp_path / "two.csv", header, columns), tmp_path, capsys)[0])
    assert {name: joint["motor"]["velocity"]["column"] for name, joint in mapped["joints"].items()} == {
        "j1": "dq1",
        "j2": "dq2",
    }


def test_a_date_in_one_column_and_the_time_of_day_in_another_are_a_time(tmp_path):
    day = [f"2026-03-01;23:59:{58 + t:06.3f}" if t < 2 else f"2026-03-02;00:00:{t - 2:06.3f}" for t in T]
    rows = [f"{d};{u:.6f};{q:.6f}".replace(".", ",") for d, u, q in zip(day, TORQUE, ANGLE, strict=True)]
    (tmp_path / "log.csv").write_text("Datum;Zeit;Moment [Nm];Winkel [rad]\n" + "\n".join(rows) + "\n")
    recording = open_recording(tmp_path / "log.csv")
    assert np.allclose(recording.topics[STATES].time(), T, atol=1e-6)
    began = datetime(2026, 3, 1, 23, 59, 58, tzinfo=UTC).timestamp()
    assert recording.topics[STATES].stamp[0] * 1e-9 == pytest.approx(began, abs=1e-3)
    assert np.allclose(recording.topics[STATES].signal("joint", "position"), ANGLE, atol=1e-6)


def test_a_date_says_nothing_of_when_elapsed_time_began(tmp_path):
    rows = [f"2026-03-01,{t:.3f},{u:.6f},{q:.6f}" for t, u, q in zip(T, TORQUE, ANGLE, strict=True)]
    header = "date,time [s],torque [Nm],angle [rad]\n"
    (tmp_path / "log.csv").write_text(header + "\n".join(rows) + "\n")
    assert open_recording(tmp_path / "log.csv").topics[STATES].stamp[0] == 10**18


def test_a_header_that_is_there_again_is_passed_over_and_told(tmp_path):
    path = plain_table(tmp_path / "log.csv")
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:700], lines[0], *lines[700:]]) + "\n")
    recording = open_recording(path)
    assert np.allclose(recording.topics[STATES].signal("joint", "position"), ANGLE, atol=1e-8)
    assert "the header is there again in line 701" in " ".join(recording.experiment["import"]["read"])
    # Where the time starts anew behind it, these are two recordings.
    path.write_text("\n".join([*lines[:700], *lines]) + "\n")
    with pytest.raises(ValueError, match="the time starts anew at row 700"):
        open_recording(path)


@pytest.mark.parametrize("unit", ["[ft*furlong]", "[bar]", "(N*furlong)"])
def test_a_unit_that_is_not_known_is_asked_for_and_not_replaced_by_another(tmp_path, capsys, unit):
    names = ("time [s]", f"torque {unit}", "motor [deg]", "link [deg]")
    out, _ = suggested(table(tmp_path / "log.csv", names, COLUMNS), tmp_path, capsys)
    assert "unit: FILL IN" in line_of(out, "input:") and "which is no unit" in line_of(out, "input:")


@pytest.mark.parametrize("unit", ["[%]", "(%)"])
def test_a_torque_in_percent_is_of_the_rated_one(tmp_path, capsys, unit):
    names = ("time [s]", f"torque {unit}", "motor [deg]", "link [deg]")
    out, _ = suggested(table(tmp_path / "log.csv", names, COLUMNS), tmp_path, capsys)
    assert "stated" in line_of(out, "input:")


def test_what_stands_in_brackets_and_is_no_unit_leaves_the_unit_to_be_guessed(tmp_path, capsys):
    names = ("time [s]", "torque (measured)", "motor [deg]", "link [deg]")
    out, _ = suggested(table(tmp_path / "log.csv", names, COLUMNS), tmp_path, capsys)
    assert "FILL IN" not in line_of(out, "input:")


@pytest.mark.parametrize(("unit", "size"), [("ft*lb", 0.3048 * 4.4482216), ("grad", np.pi / 200.0)])
def test_units_of_some_trades_are_known(unit, size):
    found = unit_of(unit)
    assert found is not None and found.factor == pytest.approx(size)


def test_stamps_of_more_digits_than_a_number_holds_are_read_from_parquet(tmp_path):
    stamps = 1_763_000_000_000_000_001 + np.round(T * 1e9).astype(np.int64)
    frame = pyarrow.table({"time [ns]": stamps, "torque [Nm]": TORQUE, "motor [rad]": ANGLE})
    pyarrow.parquet.write_table(frame, tmp_path / "log.parquet")
    series = open_recording(tmp_path / "log.parquet").topics[STATES]
    np.testing.assert_allclose(np.diff(series.time()), np.diff(T), atol=1e-6)


def test_a_few_logs_are_each_told_as_one_alone(tmp_path, capsys):
    for name in ("one", "two"):
        table(tmp_path / f"{name}.csv", HEADER, COLUMNS)
    assert main([*map(str, sorted(tmp_path.glob("*.csv"))), "--output", str(tmp_path / "bags")]) == 0
    assert capsys.readouterr().out.count("motor position: ") == 2
