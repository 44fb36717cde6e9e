"""Errors of free runs over stretches of several lengths, where the longest ones mislead."""

import math

import numpy as np
import pytest
from stepped_machines import DT, RIGID, drive, swing

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.horizons import Horizons
from haptic_teleop_sysid.diagnosis.evidence.proof import Course
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.windows import Windows, cut, fewer

FRICTION = Effect("coulomb_friction", "j_motor", {"torque": 0.4})
RIGHT = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.05}).with_effects(FRICTION)
#: What a structure without friction makes of these recordings.
HEAVY = RIGID.with_values({"motor_inertia": 1.0, "motor_damping": 0.1})


def rubbing(seed: int) -> DataSet:
    """A joint with dry friction of 0.4 N·m, pushed to one side by 0.15 N·m that nobody knows of."""
    torque = drive(seed, 1.0)
    angle = 1e-4 * np.round(swing(torque, 0.14, 0.05, 0.4, 0.0, 0.15, 0.0, 0.0) / 1e-4)
    valid = np.ones(len(torque), dtype=bool)
    speed = np.gradient(angle, DT)
    return DataSet("made here", "generic", "j", DT, torque, "N*m", "measured", angle, speed, valid=valid)


@pytest.fixture(scope="module")
def course() -> Course:
    data = (rubbing(0), rubbing(1))
    return Course(data, tuple(cut(d, None, "") for d in data))


@pytest.fixture(scope="module")
def horizons(course: Course) -> Horizons:
    return Horizons.of(course, 1, cutoff=2.0)


def test_right_friction_loses_over_the_whole_recordings_and_wins_in_the_mean(horizons):
    right, heavy = horizons.by_length(RIGHT), horizons.by_length(HEAVY)
    assert np.all(right[0] > 1.2 * heavy[0])
    assert np.all(right[-1] < 0.6 * heavy[-1])
    assert all(a < 0.8 * b for a, b in zip(horizons.errors(RIGHT), horizons.errors(HEAVY), strict=True))


def test_lengths_are_the_windows_and_some_periods_of_the_motion(horizons):
    spans = [[b - a for a, b in c.windows[0].spans] for c in horizons.courses]
    assert [set(s) for s in spans] == [{10000}, {1000}, {250}]
    assert horizons.shortest is horizons.courses[-1]
    means = np.exp(np.mean(np.log(horizons.by_length(RIGHT)), axis=0))
    assert horizons.errors(RIGHT) == pytest.approx(tuple(means))
    assert horizons.percent(RIGHT) == pytest.approx(100.0 * (1.0 - horizons.by_length(RIGHT).mean(axis=0)))


def test_lengths_that_the_samples_do_not_allow_or_that_are_the_same_are_left_out(course):
    assert len(Horizons.of(course, 1, cutoff=200.0).courses) == 2  # 20 samples are the least, twice
    assert len(Horizons.of(course, 1, cutoff=0.02).courses) == 1  # one period is 50 s


def test_a_model_without_error_has_the_least_that_counts(course):
    answered = Horizons((course,), 1)
    assert all(math.isclose(e, 0.002) for e in Answers((course,), 1).errors(RIGHT))
    assert all(e > 0.002 for e in answered.errors(RIGHT))


class Answers(Horizons):
    """Free runs that do not err."""

    def by_length(self, model):
        return np.zeros((1, 2))


@pytest.mark.parametrize(
    ("counts", "most", "left"),
    [
        ((3, 4), 10, [3, 4]),
        ((60, 30), 10, [6, 3]),
        ((1, 50), 10, [1, 8]),
        ((1, 1, 1), 2, [1, 1, 1]),
        ((299,), 200, [149]),
    ],
)
def test_of_many_windows_a_few_are_taken_from_all_of_the_recording(counts, most, left):
    whole = [Windows(tuple((20 * k, 20 * k + 20) for k in range(n)), 0.04, "as asked") for n in counts]
    found = fewer(whole, most)
    assert [len(w.spans) for w in found] == left
    for one, all_ in zip(found, whole, strict=True):
        assert set(one.spans) <= set(all_.spans)
        assert len(one.spans) == 1 or len(np.unique(np.diff([a for a, _ in one.spans]))) == 1
