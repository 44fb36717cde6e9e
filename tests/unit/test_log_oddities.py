"""What `import` tells of a log that is well formed and still not what it seems."""

import numpy as np
import pytest
from joint_logs import machine, mapping_file, table

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sysid.logs.opened import open_recording

T, TORQUE, ANGLE, SPEED = machine()
STATES = "/plant/joint_states"
HEADER = ("time [s]", "torque [Nm]", "q [rad]", "dq [rad/s]")


def notes(path, mapping=None):
    return " ".join(open_recording(path, mapping).problems)


@pytest.mark.parametrize("fill", [-9999.0, 1e30, 32767.0])
def test_a_fill_value_is_no_reading_and_that_is_told(tmp_path, fill):
    angle = ANGLE.copy()
    angle[100:900:50] = fill
    log = table(tmp_path / "log.csv", HEADER[:3], (T, TORQUE, angle))
    recording = open_recording(log)
    found = recording.topics[STATES].signal("joint", "position")
    assert np.array_equal(np.isnan(found), angle == fill)
    assert np.allclose(found[angle != fill], ANGLE[angle != fill], atol=1e-8)
    told = " ".join(recording.problems)
    assert "in 16 rows" in told and "no number in 16 of 1500 rows" in told


def test_a_position_without_a_number_is_named_and_not_called_absent(tmp_path):
    log = table(tmp_path / "log.csv", HEADER[:3], (T, TORQUE, np.full_like(ANGLE, np.nan)))
    with pytest.raises(ConfigurationError, match=r"'q \[rad\]' holds no number"):
        open_recording(log)


@pytest.mark.parametrize("value", [-9998.0, 2.5, 0.4])
def test_a_number_that_no_logger_fills_with_is_kept(tmp_path, value):
    angle = ANGLE.copy()
    angle[100] = value
    recording = open_recording(table(tmp_path / "log.csv", HEADER[:3], (T, TORQUE, angle)))
    assert recording.topics[STATES].signal("joint", "position")[100] == value
    counts = np.linspace(-9999.0, 3000.0, len(T)) / 1000.0 * np.cos(T)  # -9.999 in one row, among its like
    counts = np.rint(1000.0 * counts)
    text = "time: time\njoints: {j: {motor: {position: {column: 2, unit: counts, counts_per_turn: 4096}}}}\n"
    log = table(tmp_path / "counts.csv", ("time [s]", "q"), (T, counts))
    found = open_recording(log, mapping_file(tmp_path / "mapping.yaml", text))
    assert np.allclose(found.topics[STATES].signal("j", "position"), counts * 2 * np.pi / 4096)


def test_a_signal_of_one_value_is_told(tmp_path):
    still = table(tmp_path / "still.csv", HEADER[:3], (T, TORQUE, 0.0 * ANGLE + 0.3))
    assert "is 0.3 in every row: the joint does not move" in notes(still)
    idle = table(tmp_path / "idle.csv", HEADER[:3], (T, 0.0 * TORQUE, ANGLE))
    assert "is 0 in every row: nothing drives the joint" in notes(idle)
    assert not notes(table(tmp_path / "good.csv", HEADER, (T, TORQUE, ANGLE, SPEED)))


def test_a_position_that_freezes_while_its_velocity_goes_on_is_told(tmp_path):
    rough = np.rint(ANGLE / 2e-4) * 2e-4
    frozen = rough.copy()
    fast = int(np.argmax(np.abs(SPEED[200:-200]))) + 200
    frozen[fast - 40 : fast + 40] = frozen[fast - 40]
    log = table(tmp_path / "log.csv", HEADER, (T, TORQUE, frozen, SPEED))
    assert f"stands still for 80 rows from row {fast - 39} on" in notes(log)
    # A coarse encoder stands still for as many rows, but no longer than its steps make it.
    coarse = np.rint(ANGLE / 0.05) * 0.05
    assert "stands still" not in notes(table(tmp_path / "c.csv", HEADER, (T, TORQUE, coarse, SPEED)))


def test_one_column_for_two_signals_is_refused(tmp_path):
    log = table(tmp_path / "log.csv", HEADER, (T, TORQUE, ANGLE, SPEED))
    text = "time: time\njoints: {{j: {{input: {{column: {0}, unit: N*m}}, motor: {{position: {1}}}}}}}\n"
    mapping = mapping_file(tmp_path / "mapping.yaml", text.format(3, "q"))
    with pytest.raises(ConfigurationError, match=r"'q \[rad\]' is both input and motor_position of j"):
        open_recording(log, mapping)
    both = "time: time\njoints: {a: {motor: {position: q}}, b: {motor: {position: q}}}\n"
    assert "both column 'q [rad]'" in notes(log, mapping_file(tmp_path / "both.yaml", both))
