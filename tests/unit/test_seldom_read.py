"""Logs that are written more often than their encoder is read, and logs on irregular stamps with holes."""

import numpy as np
import pytest

from haptic_teleop_sysid.estimation.records import records_from
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.seldom_read import seldom_read
from haptic_teleop_sysid.recordings.time_grid import TimeGrid

TIME = 0.005 * np.arange(4000)
ANGLE = 3.0 * np.sin(1.3 * TIME) + np.sin(3.1 * TIME)


def in_steps(angle: np.ndarray, step: float) -> np.ndarray:
    return np.rint(angle / step) * step


@pytest.mark.parametrize("period", [2, 3, 4])
def test_repeats_between_readings_count_as_not_read(period):
    read = in_steps(ANGLE, 1e-3)[(np.arange(4000) // period) * period]
    expected = np.arange(4000) % period != 0
    found = seldom_read(read)
    assert np.mean(found == expected) > 0.98
    assert not found[~expected].any()  # nor where the joint turns, and a new reading repeats the last one


def test_stamps_that_jitter_by_a_sample_are_no_other_reading():
    rng = np.random.default_rng(1)
    at = np.cumsum(rng.choice([3, 4, 4, 4, 5], 1000))
    last = at[np.clip(np.searchsorted(at, np.arange(4000), side="right") - 1, 0, None)]
    found = seldom_read(in_steps(ANGLE, 1e-3)[np.clip(last, 0, 3999)])
    assert np.mean(found) == pytest.approx(0.75, abs=0.03)


def test_repeats_of_a_joint_that_runs_up_to_a_steady_speed_are_told_from_an_encoder_s_steps():
    speed = 50.0 * (1.0 - np.exp(-TIME / 0.05))
    angle = np.cumsum(speed) * 0.005
    found = seldom_read(in_steps(angle, 0.002)[(np.arange(4000) // 4) * 4])
    assert np.mean(found) == pytest.approx(0.75, abs=0.01)


@pytest.mark.parametrize("step", [1e-3, 0.02, 0.3])
def test_steps_of_an_encoder_are_no_repeats(step):
    assert not seldom_read(in_steps(ANGLE, step)).any()
    assert not seldom_read(in_steps(0.7 * TIME, step)).any()  # at one speed, its steps are even


def test_a_joint_that_rests_repeats_its_angle_by_itself():
    resting = np.concatenate([np.zeros(1000), ANGLE[:3000]])
    found = seldom_read(in_steps(resting, 1e-3)[(np.arange(4000) // 4) * 4])
    assert not found[:1000].any() and np.mean(found[1010:]) > 0.7


def test_what_is_read_so_seldom_does_not_cut_a_record():
    angle = in_steps(ANGLE, 1e-3)[(np.arange(4000) // 4) * 4]
    angle[seldom_read(angle)] = np.nan
    assert np.mean(np.isnan(angle)) == pytest.approx(0.75, abs=0.02)
    speed, valid = np.gradient(ANGLE, TIME), np.ones(4000, dtype=np.bool_)
    data = DataSet("made", "generic", "j", 0.005, ANGLE, "N*m", "measured", angle, speed, valid=valid)
    (record,) = records_from(data)
    assert len(record) > 3990


def test_what_is_read_more_seldom_still_is_left_to_who_recorded_it():
    assert not seldom_read(in_steps(ANGLE, 1e-3)[(np.arange(4000) // 5) * 5]).any()


def test_single_precision_makes_no_other_steps():
    turning = in_steps(1.0 * TIME + 0.05 * np.sin(2.0 * TIME), 2.0 * np.pi / 2000).astype(np.float32)
    assert not seldom_read(turning.astype(np.float64)).any()


def test_a_value_that_is_missing_costs_none_elsewhere():
    """Messages that were lost are bridged as ever, also where one value elsewhere is not a number."""
    rng = np.random.default_rng(3)
    keep = np.flatnonzero(rng.uniform(size=4000) > 0.05)
    stamps = np.rint(1e9 * TIME[keep]).astype(np.int64)
    grid = TimeGrid(np.arange(len(keep)), stamps, TIME, 0.005, True, np.ones(4000, dtype=np.bool_))
    values = ANGLE[keep]
    values[2000] = np.nan
    assert np.sum(~np.isfinite(grid.sampled(values))) <= 2


def test_values_that_are_missing_on_irregular_stamps_cost_no_others():
    """Of one reading in four each is there, at the grid's time that is nearest to it, and exact on a line."""
    rng = np.random.default_rng(2)
    stamps = np.rint(1e9 * (TIME + 0.001 * rng.uniform(-1.0, 1.0, 4000))).astype(np.int64)
    keep = np.arange(4000)
    grid = TimeGrid(keep, stamps, TIME, 0.005, True, np.ones(4000, dtype=np.bool_))
    line = np.where(keep % 4 == 0, 2.0 * (stamps - stamps[0]) * 1e-9, np.nan)
    found = grid.sampled(line)
    there = np.isfinite(found)
    assert np.mean(there) == pytest.approx(0.25, abs=0.02)
    assert np.all(np.min(np.abs(np.flatnonzero(there)[:, None] - keep[None, ::4]), axis=1) <= 1)
    between = there & ((stamps[3996] - stamps[0]) * 1e-9 > TIME)  # not behind the last one
    assert found[between] == pytest.approx(2.0 * TIME[between], abs=1e-9)
