"""`import --suggest` proposes the mapping that a log is of, and says how sure it is of each entry."""

import numpy as np
import pytest
from joint_logs import HEADER, machine, mapping_file, plain_table, table
from log_bags import bag

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.commands.import_log import main
from haptic_teleop_sysid.logs.guess import guess_time
from haptic_teleop_sysid.logs.opened import open_recording

T, TORQUE, ANGLE, SPEED = machine()
DATA = (1e3 * T, 1e3 * TORQUE, np.degrees(ANGLE))
STATES = "/plant/joint_states"


def suggested(log, tmp_path, capsys):
    capsys.readouterr()
    assert main([str(log), "--suggest"]) == 0
    captured = capsys.readouterr()
    (tmp_path / "suggested.yaml").write_text(captured.out)
    return captured


@pytest.mark.parametrize("scale", [1.0, 180.0 / np.pi])
@pytest.mark.parametrize("rate_scale", [1.0, 180.0 / np.pi, 30.0 / np.pi])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_suggestion_finds_the_units_by_the_derivative_and_the_sign_by_the_power(
    tmp_path, capsys, scale, rate_scale, sign
):
    log = table(
        tmp_path / "log.csv", ("t", "tau", "q", "dq"), (T, sign * TORQUE, scale * ANGLE, rate_scale * SPEED)
    )
    suggested(log, tmp_path, capsys)
    recording = open_recording(log, tmp_path / "suggested.yaml")
    states = recording.topics[STATES]
    assert np.allclose(states.signal("joint", "position"), ANGLE, atol=1e-6)
    assert np.allclose(states.signal("joint", "velocity"), SPEED, atol=1e-6)
    assert np.allclose(states.signal("joint", "effort"), TORQUE, atol=1e-6)


def test_a_suggestion_says_how_sure_it_is_and_what_is_missing(tmp_path, capsys):
    counts = np.rint(ANGLE / (2 * np.pi) * 8192)
    log = table(tmp_path / "log.csv", ("time [ms]", "i_q", "enc", "noise"), (1e3 * T, TORQUE, counts, T))
    captured = suggested(log, tmp_path, capsys)
    assert "# stated" in captured.out and "# guessed: input by its name; A by its name" in captured.out
    assert "counts_per_turn: FILL IN" in captured.out and "#   noise" in captured.out
    assert "1 stated" in captured.err and "1 missing" in captured.err
    with pytest.raises(ConfigurationError, match="counts_per_turn is 'FILL IN'"):
        open_recording(log, tmp_path / "suggested.yaml")
    both = table(
        tmp_path / "both.csv", ("time [ms]", "i_q", "enc", "omega"), (1e3 * T, TORQUE, counts, SPEED)
    )
    assert "counts_per_turn: 8192" in suggested(both, tmp_path, capsys).out
    slow = (1e3 * T, TORQUE, counts, SPEED * 30.0 / np.pi)
    rpm = table(tmp_path / "rpm.csv", ("time [ms]", "i_q", "enc", "omega"), slow)
    out = suggested(rpm, tmp_path, capsys).out
    assert "counts_per_turn: 8192" in out and "unit: rpm" in out  # by rad/s it would be 858


def test_a_duty_cycle_in_percent_is_an_input_and_a_battery_is_none(tmp_path, capsys):
    header = ("t [s]", "battery [%]", "duty [%]", "angle [rad]")
    duty = 40.0 * TORQUE / np.max(np.abs(TORQUE))
    log = table(tmp_path / "log.csv", header, (T, 80.0 - 0.01 * T, duty, ANGLE), digits=12)
    states = open_recording(log).topics[STATES]
    assert np.allclose(states.signal("joint", "effort"), 0.01 * duty, atol=1e-9)
    suggested(log, tmp_path, capsys)
    again = open_recording(log, tmp_path / "suggested.yaml").topics[STATES]
    assert np.allclose(again.signal("joint", "effort"), 0.01 * duty, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "role", "whole"), [("position", "position", 4.0), ("speed", "velocity", 20.0)]
)
def test_a_motion_in_percent_is_asked_of_what(tmp_path, capsys, name, role, whole):
    """A valve's place, a speed of the rated one: a percentage of what is not in the log."""
    values = 100.0 * (ANGLE if role == "position" else SPEED) / whole
    log = table(tmp_path / "log.csv", ("t [s]", "torque [Nm]", f"{name} [%]"), (T, TORQUE, values), digits=12)
    captured = suggested(log, tmp_path, capsys)
    line = next(one for one in captured.out.splitlines() if f"{name} [%]" in one)
    assert line.strip().startswith(f"{role}: ") and "unit: FILL IN" in line and "'%': of what?" in line
    unit = {"position": "rad", "velocity": "rad/s"}[role]
    filled = captured.out.replace("unit: FILL IN", f'unit: "%", gain: {whole / 100.0}, gain_unit: {unit}/%')
    (tmp_path / "filled.yaml").write_text(filled)
    read = open_recording(log, tmp_path / "filled.yaml").topics[STATES]
    expected = values * whole / 100.0
    if role == "velocity":  # it is integrated
        assert np.allclose(np.gradient(read.signal("joint", "position"), T)[9:-9], expected[9:-9], atol=0.05)
    else:
        assert np.allclose(read.signal("joint", "position"), expected, atol=1e-9)


def test_counts_of_a_pwm_are_a_share_of_the_full_drive_by_their_gain(tmp_path):
    counts = np.rint(255.0 * TORQUE / np.max(np.abs(TORQUE)))
    log = table(tmp_path / "log.csv", ("t [s]", "pwm", "angle [rad]"), (T, counts, ANGLE), digits=12)
    text = (
        "time: 't [s]'\njoints: {j: {input: {column: pwm, unit: counts, gain: 0.00392156862745098, "
        "gain_unit: pu/count}, motor: {position: 'angle [rad]'}}}\n"
    )
    states = open_recording(log, mapping_file(tmp_path / "mapping.yaml", text)).topics[STATES]
    assert np.allclose(states.signal("j", "effort"), counts / 255.0, atol=1e-9)


def test_a_suggestion_takes_a_joint_that_a_force_drives_for_linear(tmp_path, capsys):
    log = table(tmp_path / "log.csv", ("t", "force", "x", "v"), (T, TORQUE, 1e3 * ANGLE, SPEED))
    out = suggested(log, tmp_path, capsys).out
    assert "position: {column: x, unit: mm}  # likely" in out
    assert "velocity: {column: v, unit: m/s}  # likely" in out


def test_columns_of_one_name_go_by_number_and_counters_of_rows_are_no_time(tmp_path, capsys):
    header = ("sample", "q [deg]", "q [deg]", "u [Nm]")
    log = table(tmp_path / "log.csv", header, (1e3 * T, DATA[2], 0.9 * DATA[2], TORQUE))
    out = suggested(log, tmp_path, capsys).out
    assert "time: {rate: FILL IN}" in out
    assert "{column: 2, unit: deg}  # guessed" in out and "{column: 3, unit: deg}  # guessed" in out


@pytest.mark.parametrize(("unit", "scale"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_suggestion_finds_the_unit_of_time_by_its_steps(tmp_path, capsys, unit, scale):
    log = table(tmp_path / "log.csv", ("t", "tau", "q"), (scale * T, TORQUE, ANGLE), digits=15)
    assert f"time: {{column: t, unit: {unit}}}" in suggested(log, tmp_path, capsys).out


@pytest.mark.parametrize(
    ("rate", "scale", "unit", "or_else"),
    [
        (19.2, 1.0, "s", "in ms it has 1.92e+04 rows"),
        (10.0, 1e3, "ms", "in us it has 1e+04 rows"),
        (1000.0, 1e6, "us", ""),
        (1000.0, 1e3, "ms", ""),
        (1e4, 1.0, "s", ""),
    ],
)
def test_a_slow_log_comes_before_one_that_is_a_thousand_times_faster(rate, scale, unit, or_else):
    """19 rows a second are likelier than 19000, which are not excluded."""
    guess = guess_time(scale * (5.0 + np.arange(300) / rate), "")
    assert guess.unit == unit and or_else in guess.why
    assert guess.sure == ("guessed" if or_else else "likely")


def test_a_speed_that_was_recorded_is_no_input_where_another_column_drives(tmp_path, capsys):
    """Numbered columns: a motion in degrees, its rate as a tachometer has it (3 % off), and what drives."""
    rate = 1.03 * np.degrees(SPEED) + 2.0
    log = table(tmp_path / "log.csv", ("c1", "c2", "c3", "c4"), (T, rate, np.degrees(ANGLE), TORQUE))
    out = suggested(log, tmp_path, capsys).out
    assert "input: {column: c4" in out and "position: {column: c3" in out


@pytest.mark.parametrize("beside", ["arm", "acceleration"])
def test_an_input_that_the_speed_follows_closely_is_no_measured_speed(tmp_path, capsys, beside):
    """A geared drive: what is asked of it is nearly its speed. Neither a second position nor an acceleration
    drives it."""
    t = 0.002 * np.arange(5000)
    angle = np.sin(2.0 * t) + 0.3 * np.sin(5.1 * t)
    speed, acceleration = np.gradient(angle, t), np.gradient(np.gradient(angle, t), t)
    volt = 3.0 * speed + 0.05 * acceleration
    noise = np.random.default_rng(1).normal(size=len(t))
    other = 0.98 * angle + 1e-3 * noise if beside == "arm" else acceleration + 0.5 * noise
    log = table(tmp_path / "log.csv", ("c1", "c2", "c3", "c4"), (t, volt, angle, other))
    assert "input: {column: c2" in suggested(log, tmp_path, capsys).out


def test_a_suggestion_for_what_says_all_needs_no_mapping(tmp_path, capsys):
    captured = suggested(plain_table(tmp_path / "log.csv"), tmp_path, capsys)
    assert "nothing is open" in captured.err
    direct, by_mapping = (
        open_recording(tmp_path / "log.csv", m) for m in (None, tmp_path / "suggested.yaml")
    )
    assert np.array_equal(direct.topics[STATES].position, by_mapping.topics[STATES].position)


def test_a_suggestion_for_a_bag_names_its_joints(tmp_path, capsys):
    log = bag(tmp_path / "log.bag", "ros1")
    captured = suggested(log, tmp_path, capsys)
    assert "elbow:" in captured.out and "REP 103" in captured.out
    assert "arm:" not in captured.out  # the controller's state tells of the same joint once more
    recording = open_recording(log, tmp_path / "suggested.yaml")
    assert np.array_equal(recording.topics[STATES].signal("elbow", "position"), ANGLE[:60])


def test_angles_that_jump_by_a_turn_are_told_and_unwrapped_on_demand(tmp_path, capsys):
    wrapped = np.degrees(np.angle(np.exp(1j * 20.0 * ANGLE)))
    log = table(tmp_path / "log.csv", HEADER, (*DATA[:2], wrapped))
    suggested(log, tmp_path, capsys)
    turned = open_recording(log, tmp_path / "suggested.yaml").topics[STATES].signal("joint", "position")
    assert np.allclose(turned - turned[0], 20.0 * (ANGLE - ANGLE[0]), atol=1e-6)
    text = "time: time\njoints: {j: {input: torque, motor: {position: angle}}}\n"
    told = open_recording(log, mapping_file(tmp_path / "mapping.yaml", text))
    assert "jumps by a whole turn" in " ".join(told.problems)


def test_names_of_any_characters_survive_a_suggestion(tmp_path, capsys):
    header = ("time: [ms]", "# torque: {x}  [Nmm]", "yes 'angle'  no [deg]")
    log = table(tmp_path / "log.csv", header, DATA, ";", lines=["logger"])
    suggested(log, tmp_path, capsys)
    states = open_recording(log, tmp_path / "suggested.yaml").topics[STATES]
    assert np.allclose(states.signal("joint", "position"), ANGLE, atol=1e-8)


def test_a_velocity_that_was_filtered_and_is_late_does_not_reverse_the_input(tmp_path, capsys):
    late = np.concatenate([np.zeros(160), SPEED[:-160]])
    assert np.mean(TORQUE * late) < 0.0 < np.mean(TORQUE * SPEED)
    log = table(tmp_path / "log.csv", ("t", "tau", "q", "dq"), (T, TORQUE, ANGLE, late))
    suggested(log, tmp_path, capsys)
    recording = open_recording(log, tmp_path / "suggested.yaml")
    assert np.allclose(recording.topics[STATES].signal("joint", "effort"), TORQUE, atol=1e-6)
    assert not any("brakes" in problem for problem in recording.problems)
