"""Two recordings of one run are told, however they were cut, moved or resampled."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, stage_recording

from haptic_teleop_sysid.diagnosis.inputs.one_run import shared_seconds, with_one_run_told
from haptic_teleop_sysid.recordings.dataset import load_dataset

ARRAYS = ("input", "motor_position", "motor_velocity", "arm_position", "arm_velocity", "valid")


def loaded(seed, **more):
    return replace(
        load_dataset(stage_recording(STAGE, seed=seed, seconds=12.0, **more), STAGE), name=f"run{seed}"
    )


def part(data, kept):
    """The samples ``kept`` (a slice) of a data set."""
    step = kept.step or 1
    arrays = {n: v[kept] for n in ARRAYS if (v := getattr(data, n)) is not None and len(v)}
    return replace(data, name="part", dt=step * data.dt, commanded_input=None, exogenous=None, **arrays)


@pytest.fixture(scope="module")
def runs():
    return loaded(1), loaded(2)


@pytest.mark.parametrize("kept", [slice(0, None, 2), slice(1000, None), slice(777, 5000), slice(3, None, 3)])
def test_cut_and_thinned_readings_are_those_of_one_run(runs, kept):
    found = part(runs[0], kept)
    assert shared_seconds(found, runs[0]) == pytest.approx(len(found) * found.dt, abs=0.05)
    assert shared_seconds(found, runs[1]) is None


def test_another_zero_and_noise_hide_nothing(runs):
    noise = 2e-5 * np.random.default_rng(3).standard_normal(len(runs[0]))
    moved = replace(runs[0], name="moved", motor_position=runs[0].motor_position + 0.7 + noise)
    assert shared_seconds(moved, runs[0]) is not None


def test_the_same_input_once_more_is_another_run():
    """Disturbances make another motion of it."""
    one, other = (loaded(1, disturbance=d) for d in (0.01, 0.02))
    assert np.array_equal(one.input, other.input)
    assert shared_seconds(one, other) is None


def test_it_is_told_of_the_later_one_and_not_within_a_kind(runs):
    one, other = runs
    twin = part(one, slice(0, None, 2))
    estimation, validation, test = with_one_run_told([one], [other], [twin])
    assert estimation == [one] and validation == [other]
    assert "proves nothing of the other" in test[0].problems[-1] and "run1" in test[0].problems[-1]
    assert with_one_run_told([one, twin], [other], [])[0][1].problems == twin.problems


@pytest.mark.parametrize(("rate", "top", "away"), [(100.0, 4.0, 1e-4), (50.0, 2.0, 1e-3)])
def test_a_robot_that_repeats_itself_well_makes_two_runs(runs, rate, top, away):
    """Ten and a hundred steps of its encoder apart, at a rate at which the motion itself has third
    differences."""
    rng = np.random.default_rng(4)
    time = np.arange(round(12.0 * rate)) / rate

    def smooth(size, highest):
        return size * sum(
            np.sin(2.0 * np.pi * f * time + rng.uniform(0.0, 6.0)) for f in np.linspace(0.2, highest, 8)
        )

    angle, effort = smooth(0.2, top), smooth(0.3, top)

    def run(more):
        read = 1e-5 * np.round((angle + more) / 1e-5)
        noise = 0.003 * rng.standard_normal(len(time))
        found = part(runs[0], slice(0, len(time)))
        return replace(found, dt=1.0 / rate, motor_position=read, input=effort + noise)

    one, other = run(0.0 * time), run(smooth(0.4 * away, 0.5))
    assert shared_seconds(one, other) is None
    assert shared_seconds(part(one, slice(100, None)), one) is not None


def test_what_hardly_moves_or_moves_straight_says_nothing(runs):
    one = runs[0]
    straight = replace(one, motor_position=0.3 * np.arange(len(one)) * one.dt)
    assert shared_seconds(straight, straight) is None
    assert shared_seconds(part(one, slice(0, 100)), one) is None, "too short"
    step = 1e-3
    hardly = replace(one, motor_position=step * np.round(one.motor_position / np.ptp(one.motor_position) * 9))
    assert shared_seconds(hardly, hardly) is None
