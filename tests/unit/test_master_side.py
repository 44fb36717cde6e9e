"""The master's side: desired torque, spring, feedback and their limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LawResult, MasterSettings, MasterSide
from haptic_teleop_control.laws.gain_ramp import RAMP_TIME
from haptic_teleop_control.parameters import ParameterTable

DT = 0.001


def test_the_thesis_patterns_give_their_desired_torques_independent_of_the_spring():
    for spring in (0.0, 0.3):
        master = MasterSide([MasterSettings(spring=spring)] * 2, DT)
        desired, device = master.step([0.06, 0.08], [0.0, 0.0])
        np.testing.assert_allclose(desired, [0.6, 0.8], rtol=1e-12)
        np.testing.assert_allclose(device, [-spring * 0.06, -spring * 0.08], rtol=1e-12)


def test_the_neutral_position_gives_no_torque_and_the_spring_pulls_back_to_it():
    master = MasterSide([MasterSettings(neutral=0.2, spring=0.3)], DT)
    assert [part[0] for part in master.step([0.2], [0.0])] == [0.0, 0.0]
    assert master.step([0.3], [0.0])[1][0] < 0.0 < master.step([0.1], [0.0])[1][0]


def test_the_operator_feels_the_opposite_of_the_torque_on_the_environment():
    master = MasterSide([MasterSettings(feedback_gain=0.1)], DT)
    desired, device = master.step([0.0], [0.6])
    assert desired[0] == 0.0
    assert device[0] == pytest.approx(-0.06, rel=1e-12)


def test_without_feedback_gain_the_environment_is_not_felt():
    assert MasterSide([MasterSettings()], DT).step([0.0], [5.0])[1][0] == 0.0


def test_the_feedback_is_filtered_by_the_low_pass_of_its_axis():
    settings = [MasterSettings(feedback_gain=0.1, feedback_cutoff_hz=5.0), MasterSettings(feedback_gain=0.2)]
    master = MasterSide(settings, DT)
    torques = np.random.default_rng(1).normal(scale=0.2, size=100)
    wc = 2 * math.pi * 5.0
    _, filtered, _ = signal.lsim(([wc], [1.0, wc]), [0.0, *torques], np.arange(101) * DT)
    for torque, felt in zip(torques, filtered[1:], strict=True):
        _, device = master.step([0.0, 0.0], [torque, torque])
        assert device[0] == pytest.approx(-0.1 * felt, abs=1e-12)
        assert device[1] == pytest.approx(-0.2 * torque, rel=1e-12)


def test_both_torques_are_clamped_and_it_is_said():
    master = MasterSide([MasterSettings(torque_limit=0.1, desired_torque_limit=1.0)], DT)
    for position in (0.5, -0.5):
        desired, device = master.step([position], [0.0])
        assert desired[0] == math.copysign(1.0, position)
        assert device[0] == -math.copysign(0.1, position)
        assert master.results[0] == LawResult.SATURATED
    master.step([0.01], [0.0])
    assert master.results[0] == LawResult.OK


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("argument", [0, 1])
def test_an_input_that_is_not_finite_gives_zero_for_that_axis_and_sample_only(argument, bad):
    master = MasterSide([MasterSettings(feedback_gain=0.1, feedback_cutoff_hz=5.0)] * 2, DT)
    master.step([0.01, 0.01], [0.1, 0.1])
    before = master.state
    inputs = np.array([[0.01, 0.01], [0.1, 0.1]])
    inputs[argument, 0] = bad
    desired, device = master.step(*inputs)
    assert desired[0] == 0.0 and device[0] == 0.0 and np.array_equal(master.state[0], before[0])
    assert master.results.tolist() == [LawResult.REFUSED_INPUT, LawResult.OK]
    assert desired[1] == pytest.approx(0.1)


def test_a_disabled_axis_gives_nothing():
    master = MasterSide([MasterSettings()] * 2, DT)
    master.enabled[1] = False
    desired, device = master.step([0.06, 0.06], [0.0, 0.0])
    assert desired[1] == 0.0 and device[1] == 0.0 and desired[0] > 0.0
    assert master.results[1] == LawResult.DISABLED


def test_a_reset_forgets_the_filtered_feedback():
    master = MasterSide([MasterSettings(feedback_gain=0.1, feedback_cutoff_hz=5.0)] * 2, DT)
    first = master.step([0.0, 0.0], [0.5, 0.5])[1]
    master.step([0.0, 0.0], [0.5, 0.5])
    master.reset(0)
    again = master.step([0.0, 0.0], [0.5, 0.5])[1]
    assert again[0] == first[0] and again[1] != first[1]


def test_parameters_make_and_change_it():
    table = ParameterTable("controller", MasterSide.parameters(["stage1", "stage2"]))
    master = MasterSide.from_parameters(table.check({"stage2.spring": 0.1}), ["stage1", "stage2"], DT)
    assert [s.spring for s in master.settings] == [0.3, 0.1]
    master.update(table.check({"stage1.torque_gain": 5.0}), ["stage1", "stage2"])
    for _ in range(round(RAMP_TIME / DT)):
        desired, _ = master.step([0.1, 0.1], [0.0, 0.0])
    assert desired == pytest.approx([0.5, 1.0])
    with pytest.raises(ConfigurationError, match=r"stage1\.spring is -1"):
        master.update({"stage1.spring": -1.0}, ["stage1", "stage2"])


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"torque_gain": -1.0}, "torque_gain"),
        ({"neutral": math.nan}, "neutral"),
        ({"feedback_cutoff_hz": 0.0}, "feedback_cutoff_hz"),
        ({"torque_limit": 0.5}, "torque_limit"),
        ({"desired_torque_limit": 0.0}, "desired_torque_limit"),
    ],
)
def test_settings_outside_their_range_are_refused_by_name(changes, word):
    with pytest.raises(ConfigurationError, match=word):
        MasterSettings(**changes)
