"""Gains that are changed while a law runs: nothing jumps, and the new gains are reached."""

import math

import numpy as np
import pytest

from haptic_teleop_control.laws import MasterSide
from haptic_teleop_control.laws.augmented_error import AugmentedErrorLaw
from haptic_teleop_control.laws.gain_ramp import RAMP_TIME, GainRamp
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.robots import STAGES

DT = 0.002
STEPS = round(RAMP_TIME / DT)
AXES = ("omni_y", "omni_z")


def values_of(law, names, **changes):
    defaults = ParameterTable("law", law.parameters(names)).defaults()
    return {**defaults, **{name.replace("__", "."): value for name, value in changes.items()}}


def test_a_ramp_is_a_straight_line_that_ends_bit_by_bit_where_it_was_sent():
    ramp = GainRamp(np.array([[1.0, 5.0]]), DT, at_once=(1,))
    held = ramp.value
    ramp.to(np.array([[4.0, 0.1 + 0.2]]))
    assert held[0].tolist() == [1.0, 0.1 + 0.2]
    course = []
    while ramp.moving:
        ramp.step()
        course.append(held[0, 0])
    assert np.allclose(course, 1.0 + 3.0 * np.arange(1, STEPS + 1) / STEPS, atol=1e-12)
    assert course[-1] == 4.0


def test_a_change_during_a_change_goes_on_from_where_it_is():
    ramp = GainRamp(np.array([[0.0]]), DT)
    ramp.to(np.array([[1.0]]))
    for _ in range(STEPS // 2):
        ramp.step()
    here = ramp.value[0, 0]
    ramp.to(np.array([[0.0]]))
    ramp.step()
    assert abs(ramp.value[0, 0] - here) <= 1.0 / STEPS


@pytest.mark.parametrize(
    ("start", "end"), [(0.3, math.inf), (math.inf, 0.3), (0.0, math.inf), (math.inf, math.inf)]
)
def test_a_limit_opens_and_closes_without_a_value_that_is_no_number(start, end):
    ramp = GainRamp(np.array([[start]]), DT)
    ramp.to(np.array([[end]]))
    course = [start]
    while ramp.moving:
        ramp.step()
        course.append(ramp.value[0, 0])
    assert not np.isnan(course).any()
    assert course[-1] == end
    limited = np.clip(1.0, 0.0, course)  # what the limit leaves of a torque of 1 N·m
    if min(start, end) > 0.0:
        assert np.abs(np.diff(limited)).max() < 0.05


def test_the_desired_torque_follows_a_new_master_gain_in_small_steps():
    side = MasterSide.from_parameters(values_of(MasterSide, AXES), AXES, DT)
    angle, felt = np.array([0.08, 0.05]), np.array([0.4, -0.2])
    changed = values_of(
        MasterSide, AXES, omni_y__torque_gain=25.0, omni_y__feedback_gain=0.1, omni_z__neutral=0.03
    )
    for _ in range(50):
        before = np.array(side.step(angle, felt))
    side.update(changed, AXES)
    course = np.array([before, *(side.step(angle, felt) for _ in range(STEPS))])
    wanted = MasterSide.from_parameters(changed, AXES, DT)
    for _ in range(50):
        after = np.array(wanted.step(angle, felt))
    whole = np.abs(after - before)
    assert whole.max() > 1.0
    assert np.all(np.abs(np.diff(course, axis=0)).max(axis=0) <= 1.2 * whole / STEPS + 1e-12)
    assert np.allclose(course[-1], after, atol=1e-9)


def test_the_current_follows_new_gains_of_the_force_law_in_small_steps():
    law = AugmentedErrorLaw.from_parameters(values_of(AugmentedErrorLaw, STAGES), STAGES, DT)
    # In contact, with an error that stays, so that every gain matters; the integral is held by hand.
    state = [[0.05], [0.02]]
    measured = ([0.12, 0.06], [0.02, 0.01], [0.0, 0.0], [0.05, -0.04])

    def current():
        law.state = state
        return law.step(*measured).copy()

    before = current()
    changes = {"stage1__kp": 4.0, "stage2__kdm": 0.5, "stage2__lambda": 0.8}
    law.update(values_of(AugmentedErrorLaw, STAGES, **changes), STAGES)
    course = np.array([before, *(current() for _ in range(STEPS))])
    whole = np.abs(course[-1] - before)
    assert whole.min() > 1e-3
    assert np.all(np.abs(np.diff(course, axis=0)).max(axis=0) <= 2.0 * whole / STEPS)


def test_a_change_of_gains_leaves_the_current_of_the_integrator_alone():
    law = AugmentedErrorLaw.from_parameters(values_of(AugmentedErrorLaw, STAGES), STAGES, DT)
    law.state = [[0.1], [0.05]]
    rest = [0.0, 0.0]
    before = law.step(rest, rest, rest, rest).copy()
    law.update(values_of(AugmentedErrorLaw, STAGES, stage1__kpm=20.0, stage2__stiffness=2.0), STAGES)
    course = np.array([law.step(rest, rest, rest, rest) for _ in range(STEPS)])
    assert before.min() > 0.0
    assert np.allclose(course, before, rtol=1e-9)


def test_a_reset_puts_the_new_gains_in_force():
    side = MasterSide.from_parameters(values_of(MasterSide, AXES), AXES, DT)
    side.update(values_of(MasterSide, AXES, omni_y__torque_gain=25.0), AXES)
    side.reset()
    assert side.step([0.1, 0.0], [0.0, 0.0])[0][0] == pytest.approx(2.5)
