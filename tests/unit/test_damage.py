"""Readings that no joint can have made are found and left out; what a joint can do is left alone."""

from dataclasses import replace

import numpy as np
import pytest
from joint_recordings import DT, TRUTH, excitation, joint_recording, response

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import bag_problems
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.damage import encoder_step, held, leaps, stood_still
from haptic_teleop_sysid.recordings.dataset import load_dataset

MODEL = Model("sfj", "stage1", "flexible_joint", TRUTH, source="stage1.yaml")
CURRENT = excitation(4000)
STATES = response(CURRENT)
TOPIC = "/sfj/joint_states"


def with_positions(change):
    """A recording whose positions (n, 4) were changed in place by `change`."""
    recording = joint_recording(CURRENT, STATES)
    position = recording.topics[TOPIC].position.copy()
    change(position)
    recording.topics[TOPIC] = replace(recording.topics[TOPIC], position=position)
    return recording


def with_stamps(stamp):
    recording = joint_recording(CURRENT, STATES)
    recording.topics[TOPIC] = replace(recording.topics[TOPIC], stamp=stamp)
    return recording


@pytest.mark.parametrize("size", [0.3, -1.0, 1e30])
@pytest.mark.parametrize("length", [1, 3])
def test_what_leaps_away_and_back_counts_as_not_read(size, length):
    def spike(position):
        position[1000 : 1000 + length, 1] += size
        position[2500, 1] += size

    dataset = load_dataset(with_positions(spike), MODEL, "mybag")
    assert np.flatnonzero(~dataset.valid).tolist() == [*range(1000, 1000 + length), 2500]
    assert np.max(np.abs(dataset.arm_position - STATES[:, 1])) < 0.01
    assert np.max(np.abs(dataset.arm_velocity)) < 2.0 * np.max(np.abs(STATES[:, 3]))
    assert any(f"stage1_arm.position leaps away and back at {length + 1} samples" in p
               for p in dataset.problems)  # fmt: skip


def test_a_place_reached_at_once_is_no_outlier():
    slipped = np.sin(0.01 * np.arange(2000.0))
    slipped[900:] += 3.0
    assert not leaps(slipped).any()


@pytest.mark.parametrize("seed", range(5))
def test_motion_has_no_outliers_whatever_its_resolution(seed):
    rng = np.random.default_rng(seed)
    angle = np.cumsum(np.cumsum(rng.normal(size=4000))) * 1e-5
    for step in (1e-9, 1e-4, 1e-3, 2e-2):
        counted = step * np.round(angle / step)
        assert not leaps(counted).any()


def test_a_jump_of_speed_at_a_stop_is_no_outlier():
    time = 0.002 * np.arange(3000)
    assert not leaps(np.abs(np.sin(3.0 * time))).any()


@pytest.mark.parametrize("length", [1, 2, 4, 10, 20])
@pytest.mark.parametrize("step", [1e-12, 2.5e-4])
def test_readings_that_are_held_while_the_joint_moves_count_as_not_read(length, step):
    angle = 0.4 * np.sin(4.0 * 0.002 * np.arange(4000))
    angle = step * np.round(angle / step)
    damaged = angle.copy()
    speed = np.abs(np.diff(angle, prepend=0.0))
    fast = [i for i in range(100, 3900, 60) if np.all(speed[i - 4 : i + length + 4] > 1.2e-3)]
    assert len(fast) > 30
    for i in fast:
        damaged[i : i + length] = damaged[i - 1]
    expected = sorted(i + j for i in fast for j in range(length))
    assert np.flatnonzero(held(damaged)).tolist() == expected
    assert not held(angle).any()


def test_one_value_told_over_and_over_off_the_way_is_no_reading():
    angle = 0.4 * np.sin(4.0 * 0.002 * np.arange(4000)) + 1.0
    damaged = angle.copy()
    for i in range(200, 3800, 300):
        damaged[i : i + 30] = 0.0
    assert np.flatnonzero(held(damaged)).tolist() == [i + j for i in range(200, 3800, 300) for j in range(30)]


@pytest.mark.parametrize("length", [7, 20, 40])
@pytest.mark.parametrize("columns", [[0], [1], [0, 1]])
def test_short_dropouts_shift_nothing_behind_them(length, columns):
    def drop(position):
        for start in range(300, 3900, 300):
            for c in columns:
                position[start : start + length, c] = position[start - 1, c]

    dataset = load_dataset(with_positions(drop), MODEL, "mybag", allow_gaps=True)
    assert dataset.slips == ()
    for found, true in ((dataset.motor_position, STATES[:, 0]), (dataset.arm_position, STATES[:, 1])):
        wrong = np.abs(found - true) > 2e-3
        assert np.mean(wrong) <= 12 * length / 4000
        assert np.max(np.abs(found - true)[-100:]) < 1e-5


@pytest.mark.parametrize("length", [7, 15, 30])
def test_bursts_of_outliers_count_as_not_read(length):
    def burst(position):
        for start in range(300, 3900, 300):
            position[start : start + length, 1] += 0.3

    dataset = load_dataset(with_positions(burst), MODEL, "mybag", allow_gaps=True)
    assert dataset.slips == ()
    assert np.count_nonzero(~dataset.valid) == 12 * length
    assert any("elsewhere for some samples 12 times" in p for p in dataset.problems)
    with pytest.raises(RecordingError, match=r"12 stretches.*stage1_arm.*comes back"):
        load_dataset(with_positions(burst), MODEL, "mybag")


def test_infinite_readings_are_told_once_and_without_a_warning():
    def overflow(position):
        position[500:503, 1] = np.inf

    with np.errstate(all="raise"):
        dataset = load_dataset(with_positions(overflow), MODEL, "mybag")
    assert len(dataset.problems) == 1
    assert np.flatnonzero(~dataset.valid).tolist() == [500, 501, 502]


def test_held_readings_are_told():
    def hold(position):
        speed = np.abs(np.diff(position[:, 0]))
        for i in np.flatnonzero(speed > 0.7 * speed.max())[::40] + 1:
            position[i, 0] = position[i - 1, 0]

    dataset = load_dataset(with_positions(hold), MODEL, "mybag")
    assert any("stage1_motor.position repeats one value" in p for p in dataset.problems)
    assert np.max(np.abs(dataset.motor_position - STATES[:, 0])) < 2e-3


def test_an_encoder_that_stood_still_is_left_out_with_permission():
    def freeze(position):
        position[1200:2200, 1] = position[1200, 1]

    with pytest.raises(RecordingError, match=r"mybag.*stage1_arm.position stands still.*--allow-gaps"):
        load_dataset(with_positions(freeze), MODEL, "mybag")
    dataset = load_dataset(with_positions(freeze), MODEL, "mybag", allow_gaps=True)
    missing = np.flatnonzero(~dataset.valid)
    assert missing[0] == 1200
    assert 2200 <= missing[-1] < 2200 + 0.1 / DT
    assert any("2.000 s from 2.400 s" in p for p in dataset.problems)


def test_an_encoder_that_failed_for_a_moment_of_little_motion_surely_stood_still():
    time = 0.002 * np.arange(5000)
    motor = 0.3 * np.sin(2.0 * time)
    arm = motor + 0.05 * np.sin(9.0 * time)
    turn = int(np.argmax(arm))  # where it moves least: it leaps by but a few of its fastest steps
    frozen = arm.copy()
    frozen[turn - 30 : turn + 45] = frozen[turn - 30]
    leap = abs(frozen[turn + 45] - frozen[turn + 44])
    assert leap < 12.0 * np.quantile(np.abs(np.diff(arm)), 0.995)
    assert stood_still(frozen, motor, 0.002, encoder_step(frozen)) == [(turn - 30, turn + 45, True)]


@pytest.mark.parametrize("jitter", [0.005, 0.03, 0.2])
def test_a_slow_joint_whose_stamps_jitter_does_not_stand_still(jitter):
    """On even times, between the readings, single steps of its encoder come in parts."""
    rng = np.random.default_rng(3)
    time = 0.002 * (np.arange(6000) + jitter * rng.uniform(-1.0, 1.0, 6000))
    motor = 0.05 * np.sin(2.0 * np.pi * 0.2 * time)
    arm = motor + 0.005 * np.sin(2.0 * np.pi * 0.35 * time)
    read = [np.rint(x / s) * s for x, s in ((motor, 1.534e-5), (arm, 2.462e-4))]
    even = 0.002 * np.arange(6000)
    on_grid = [np.interp(even, time, x) for x in read]
    for k in (0, 1):
        assert stood_still(on_grid[k], on_grid[1 - k], 0.002, encoder_step(read[k])) == []
    # One that failed is found there, too.
    dead = read[1].copy()
    dead[2000:2300] = dead[2000]
    found = stood_still(np.interp(even, time, dead), on_grid[0], 0.002, encoder_step(dead))
    assert [(abs(a - 2000) < 20, abs(b - 2300) < 3, sure) for a, b, sure in found] == [(True, True, True)]


def test_a_joint_that_moves_within_one_slow_sample_has_not_failed():
    # Dry friction lets it go and holds it again within 10 ms: fifteen times.
    slides = 0.1 * np.sin(0.02 * np.arange(600.0))
    sticks = slides[-1] + np.repeat(0.01 * np.arange(15.0), 60)
    motor = np.rint(np.concatenate([slides, sticks]) / 1.534e-5) * 1.534e-5
    arm = motor + 0.002 * np.sin(np.arange(1500.0))
    arm[600:] += 0.008 * (np.arange(900) % 60) / 60.0
    assert not any(sure for _, _, sure in stood_still(motor, arm, 0.01, encoder_step(motor)))
    assert any(sure for _, _, sure in stood_still(motor, arm, 0.002, encoder_step(motor)))


def test_readings_that_are_held_often_are_found_as_well():
    rng = np.random.default_rng(8)
    position = 0.4 * np.sin(2.0 * np.pi * 1.0 * 0.002 * np.arange(5000))
    for share in (0.02, 0.05, 0.1):
        late = position.copy()
        again = np.flatnonzero(rng.uniform(size=5000) < share)
        for k in again[again > 0]:
            late[k] = late[k - 1]
        fast = np.abs(np.gradient(position)) > 0.5 * np.max(np.gradient(position))
        expected = np.zeros(5000, dtype=bool)
        expected[again] = True
        expected &= fast
        assert np.sum(held(late) & expected) > 0.9 * np.sum(expected)


def test_an_arm_that_its_joint_holds_back_has_not_failed():
    # Dry friction holds the arm until the joint is wound up: over and over, so that this is how they differ.
    time = 0.002 * np.arange(5000)
    motor = 0.1 * np.sin(2.0 * time)
    arm = np.empty_like(motor)
    held = 0.0
    for i, angle in enumerate(motor):
        held += np.sign(angle - held) * max(0.0, abs(angle - held) - 0.03)
        arm[i] = held
    assert stood_still(arm, motor, 0.002, encoder_step(arm)) == []
    assert stood_still(motor, arm, 0.002, encoder_step(motor)) == []


def test_a_long_stretch_without_numbers_is_a_hole():
    def blank(position):
        position[300:700, 0] = np.nan

    with pytest.raises(RecordingError, match=r"mybag.*0\.800 s at 0\.600 s.*--allow-gaps"):
        load_dataset(with_positions(blank), MODEL, "mybag")
    dataset = load_dataset(with_positions(blank), MODEL, "mybag", allow_gaps=True)
    assert np.array_equal(np.flatnonzero(~dataset.valid), np.arange(300, 700))


def test_a_clock_that_is_set_back_is_told_and_cuts_the_recording():
    stamp = joint_recording(CURRENT, STATES).topics[TOPIC].stamp.copy()
    stamp[2000:] -= 3_000_000_000
    recording = with_stamps(stamp)
    quality = bag_problems(recording.topics[TOPIC], TOPIC)
    assert (quality.behind, quality.backwards) == (1499, 1)
    assert any("set back, by 2.998 s" in p and "1499 samples" in p for p in quality.problems)
    with pytest.raises(RecordingError, match=r"mybag.*clock.*1500 samples.*--allow-gaps"):
        load_dataset(recording, MODEL, "mybag")
    dataset = load_dataset(recording, MODEL, "mybag", allow_gaps=True)
    missing = np.flatnonzero(~dataset.valid)
    assert 0 <= missing[0] - 2000 <= 1
    assert len(missing) > 5


@pytest.mark.parametrize("jump", [4_000_000, 20_000_000, 500_000_000])
def test_a_clock_set_back_by_little_is_no_slip_either(jump):
    stamp = joint_recording(CURRENT, STATES).topics[TOPIC].stamp.copy()
    stamp[2000:] -= jump
    with pytest.raises(RecordingError, match=r"clock.*--allow-gaps"):
        load_dataset(with_stamps(stamp), MODEL, "mybag")
    dataset = load_dataset(with_stamps(stamp), MODEL, "mybag", allow_gaps=True)
    assert dataset.slips == ()
    assert np.count_nonzero(~dataset.valid) > 5


def test_a_joint_that_is_held_on_one_side_is_told_and_not_refused():
    # The motor is braked while the arm rings down: that is an experiment.
    time = 0.002 * np.arange(5000)
    motor = 0.1 * np.sin(2.0 * time) * (time < 5.0)
    arm = motor + 0.005 * np.sin(3.0 * time)
    arm[2500:] = 0.05 * np.sin(8.0 * time[2500:]) * np.exp(-(time[2500:] - 5.0))
    found = stood_still(motor, arm, 0.002, encoder_step(motor))
    assert [(a >= 2400, sure) for a, _, sure in found] == [(True, False)]
