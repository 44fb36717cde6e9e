"""The force law: its equations, its limits, and that a loop closed with it does what the thesis says."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LAWS, AugmentedErrorGains, AugmentedErrorLaw, LawResult
from haptic_teleop_control.parameters import ParameterTable

DT = 0.002
STAGES = ("stage1", "stage2")
INERTIAS = {"stage1": (0.0635, 0.17), "stage2": (0.00704, 0.0064)}
WALL = 2000.0


def both(**changes):
    return [AugmentedErrorGains.for_stage(stage, **changes) for stage in STAGES]


def joint(stage, motor_damping, arm_damping, wall):
    """Zero-order-hold transition of the two-mass joint: state (motor, arm, their rates), input current."""
    gains = AugmentedErrorGains.for_stage(stage)
    motor_inertia, arm_inertia = INERTIAS[stage]
    a = np.zeros((5, 5))
    a[0, 2] = a[1, 3] = 1.0
    a[2, :4] = [-gains.stiffness, gains.stiffness, -motor_damping, 0.0]
    a[2] /= motor_inertia
    a[3, :4] = [gains.stiffness, -gains.stiffness - wall, 0.0, -arm_damping]
    a[3] /= arm_inertia
    a[2, 4] = gains.torque_constant / motor_inertia
    step = expm(a * DT)
    return step[:4, :4], step[:4, 4]


def closed_loop(law, plant, desired, seconds):
    """Run one stage; returns states (n, 4) and currents (n,)."""
    transition, gain = plant
    state = np.zeros(4)
    states, currents = [], []
    for _ in range(round(seconds / DT)):
        current = law.step([desired], [state[0]], [state[1]], [state[2]])[0]
        states.append(state)
        currents.append(current)
        state = transition @ state + gain * current
    return np.array(states), np.array(currents)


def test_equations_25_to_32_give_the_current_worked_out_by_hand():
    gains = AugmentedErrorGains(
        lambda_=0.5,
        kp=2.0,
        ki=10.0,
        kpm=5.0,
        kdm=0.05,
        stiffness=4.0,
        torque_constant=8.0,
        current_limit=10.0,
    )
    law = AugmentedErrorLaw([gains], dt=0.1)
    # Te = 4 (0.3 - 0.2) = 0.4; s = 1 - 0.4 - 0.5 * 0.6 = 0.3; Tc = 0.4 + 2 * 0.3 + 10 * 0.3 * 0.1 = 1.3
    # motor wanted at 0.2 + 1.3 / 4 = 0.525; current = 5 (0.525 - 0.3) - 0.05 * 0.6 = 1.095
    assert law.step([1.0], [0.3], [0.2], [0.6])[0] == pytest.approx(1.095, abs=1e-12)
    assert law.augmented_error[0] == pytest.approx(0.3)
    assert law.environment_torque[0] == pytest.approx(0.4)
    assert law.state == pytest.approx(np.array([[0.3]]))
    # Once more with the same input: the integral is 0.06, so Tc = 0.4 + 0.6 + 0.6.
    assert law.step([1.0], [0.3], [0.2], [0.6])[0] == pytest.approx(
        5 * (0.2 + 1.6 / 4 - 0.3) - 0.03, abs=1e-12
    )
    assert law.results[0] == LawResult.OK


def test_below_the_limit_the_current_is_the_pi_of_the_augmented_error_alone():
    random = np.random.default_rng(5)
    gains = both(current_limit=1e9)
    law = AugmentedErrorLaw(gains, DT)
    desired, motor, arm, velocity = random.normal(
        scale=[[[0.6]], [[1.0]], [[1.0]], [[1.2]]], size=(4, 500, 2)
    )
    currents = np.array([law.step(*row) for row in zip(desired, motor, arm, velocity, strict=True)])
    for i, g in enumerate(gains):
        s = desired[:, i] - g.stiffness * (motor[:, i] - arm[:, i]) - g.lambda_ * velocity[:, i]
        integral = np.cumsum(s) * DT
        expected = g.kpm / g.stiffness * (g.kp * s + g.ki * integral) - g.kdm * velocity[:, i]
        np.testing.assert_allclose(currents[:, i], expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(("stage", "desired"), [("stage1", 0.6), ("stage2", 0.8), ("stage1", -0.6)])
def test_free_motion_settles_at_desired_torque_over_lambda(stage, desired):
    law = AugmentedErrorLaw([AugmentedErrorGains.for_stage(stage)], DT)
    states, currents = closed_loop(law, joint(stage, 0.3, 0.0, wall=0.0), desired, seconds=60.0)
    assert states[-1, 2] == pytest.approx(desired / 0.5, rel=1e-4)
    assert states[-1, 3] == pytest.approx(desired / 0.5, rel=1e-4)
    assert abs(currents[-1]) < law.gains[0].current_limit


def test_arm_friction_slows_free_motion_to_desired_torque_over_lambda_plus_its_coefficient():
    # The arm's friction needs Te = B v, so s = 0 at v = Td / (lambda + B).
    law = AugmentedErrorLaw([AugmentedErrorGains.for_stage("stage1")], DT)
    states, _ = closed_loop(law, joint("stage1", 0.3, 0.1, wall=0.0), 0.6, seconds=60.0)
    assert states[-1, 3] == pytest.approx(0.6 / 0.6, rel=1e-4)


@pytest.mark.parametrize(("stage", "desired"), [("stage1", 0.6), ("stage2", 0.8)])
def test_contact_settles_at_the_desired_torque_with_the_same_gains(stage, desired):
    law = AugmentedErrorLaw([AugmentedErrorGains.for_stage(stage)], DT)
    # The wall takes energy out of the arm, as walls do; at rest that changes no torque.
    states, _ = closed_loop(law, joint(stage, 0.6, 2.0, WALL), desired, seconds=40.0)
    g = law.gains[0]
    assert g.stiffness * (states[-1, 0] - states[-1, 1]) == pytest.approx(desired, rel=1e-4)
    assert WALL * states[-1, 1] == pytest.approx(desired, rel=1e-4)
    # The integrator alone holds it: the current is that of the joint's torque, and no P part is left.
    assert g.kpm / g.stiffness * law.state[0, 0] == pytest.approx(desired / g.torque_constant, rel=1e-3)


def test_the_integrator_does_not_wind_up_while_the_limit_holds():
    gains = AugmentedErrorGains.for_stage("stage1")
    law = AugmentedErrorLaw([gains], DT)
    for _ in range(5000):
        assert law.step([50.0], [0.0], [0.0], [0.0])[0] == gains.current_limit
    assert law.results[0] == LawResult.SATURATED
    assert law.state[0, 0] == 0.0  # the P part alone exceeds the limit
    # Without the demand the current is gone at once; wound up it would stay at the limit for 10 s.
    assert law.step([0.0], [0.0], [0.0], [0.0])[0] == pytest.approx(0.0, abs=1e-12)


def test_the_integrator_fills_exactly_up_to_the_limit():
    gains = AugmentedErrorGains.for_stage("stage1")
    law = AugmentedErrorLaw([gains], DT)
    demand = 0.2
    for _ in range(5000):
        current = law.step([demand], [0.0], [0.0], [0.0])[0]
    assert current == gains.current_limit
    full = gains.current_limit * gains.stiffness / gains.kpm - gains.kp * demand
    assert law.state[0, 0] == pytest.approx(full, rel=1e-12)
    assert law.step([-0.1], [0.0], [0.0], [0.0])[0] < gains.current_limit  # leaves the limit in one sample


def test_a_saturated_transient_leaves_the_contact_torque_that_the_integrator_holds():
    law = AugmentedErrorLaw([AugmentedErrorGains.for_stage("stage1")], DT)
    law.state = [[0.05]]
    for _ in range(200):
        law.step([5.0], [0.0], [0.0], [0.0])
    assert law.state[0, 0] == 0.05
    for _ in range(200):
        law.step([-5.0], [0.0], [0.0], [0.0])
    assert law.state[0, 0] == 0.05


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("argument", range(4))
def test_an_input_that_is_not_usable_gives_zero_current_for_that_stage_and_sample_only(argument, bad):
    law, clean = AugmentedErrorLaw(both(), DT), AugmentedErrorLaw(both(), DT)
    rows = np.array([[0.1, 0.1], [0.01, 0.01], [0.0, 0.0], [0.1, 0.1]])
    law.step(*rows)
    clean.step(*rows)
    spoiled = rows.copy()
    spoiled[argument, 0] = bad
    before = law.state
    current = law.step(*spoiled)
    expected = clean.step(*rows)
    assert current[0] == 0.0 and law.results[0] == LawResult.REFUSED_INPUT
    assert law.state[0] == before[0]
    assert math.isnan(law.augmented_error[0])
    assert current[1] == expected[1] and law.results[1] == LawResult.OK


def test_finite_inputs_that_overflow_the_equations_are_refused_too():
    law = AugmentedErrorLaw(both(), DT)
    assert law.step([1e308, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]).tolist() == [0.0, 0.0]
    assert law.results.tolist() == [LawResult.REFUSED_INPUT, LawResult.OK]
    assert not law.state.any()


def test_a_disabled_stage_gives_no_current_and_starts_afresh():
    law = AugmentedErrorLaw(both(), DT)
    arguments = ([0.1, 0.1], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0])
    first = law.step(*arguments)
    for _ in range(10):
        law.step(*arguments)
    law.enabled[0] = False
    assert law.step(*arguments)[0] == 0.0
    assert law.results.tolist() == [LawResult.DISABLED, LawResult.OK]
    law.enabled[0] = True
    assert law.step(*arguments)[0] == first[0]


def test_the_state_restores_the_moment_it_was_taken():
    law = AugmentedErrorLaw(both(), DT)
    random = np.random.default_rng(2)
    for row in random.normal(scale=0.05, size=(50, 4, 2)):
        law.step(*row)
    saved, following = law.state, random.normal(scale=0.05, size=(20, 4, 2))
    first = [law.step(*row) for row in following]
    law.state = saved
    assert np.array_equal([law.step(*row) for row in following], first)
    law.reset(0)
    assert law.state[0, 0] == 0.0 and law.state[1, 0] != 0.0
    law.reset()
    assert not law.state.any()


def test_a_change_of_gains_in_steady_contact_does_not_move_the_current():
    law = AugmentedErrorLaw([AugmentedErrorGains.for_stage("stage1")], DT)
    states, currents = closed_loop(law, joint("stage1", 2.6, 0.02, WALL), 0.6, seconds=40.0)
    law.gains = [AugmentedErrorGains.for_stage("stage1", kpm=2.0, ki=3.0, kp=1.0)]
    last = states[-1]
    assert law.step([0.6], [last[0]], [last[1]], [last[2]])[0] == pytest.approx(currents[-1], rel=1e-3)


def test_the_law_is_made_and_changed_from_parameters_named_by_stage():
    assert LAWS["augmented_error"] is AugmentedErrorLaw
    table = ParameterTable("force_controller", AugmentedErrorLaw.parameters(STAGES))
    assert {f"stage1.{name}" for name in ("lambda", "kp", "ki", "kpm", "kdm")} <= set(table.defaults())
    law = AugmentedErrorLaw.from_parameters(table.check({"stage2.lambda": 0.7}), STAGES, DT)
    assert law.gains == (*both()[:1], AugmentedErrorGains.for_stage("stage2", lambda_=0.7))
    assert law.torque_constant.tolist() == [8.925, 1.392]
    with pytest.raises(ConfigurationError, match=r"stage2\.kp is -1"):
        law.update({"stage1.kp": 3.0, "stage2.kp": -1.0}, STAGES)
    assert law.gains[0].kp == 2.0
    law.update({"stage1.kp": 3.0}, STAGES)
    assert law.gains[0].kp == 3.0


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"lambda_": 0.0}, "lambda is 0"),
        ({"kp": -1.0}, "kp"),
        ({"ki": math.nan}, "ki"),
        ({"kpm": 0.0}, "kpm"),
        ({"kdm": -0.1}, "kdm"),
        ({"stiffness": 0.0}, "stiffness"),
        ({"torque_constant": -1.0}, "torque_constant"),
        ({"current_limit": 0.0}, "current_limit"),
        ({"current_limit": math.inf}, "current_limit"),
        ({"kp": "2"}, "kp"),
    ],
)
def test_gains_outside_their_range_are_refused_by_name(changes, word):
    with pytest.raises(ConfigurationError, match=word):
        AugmentedErrorGains.for_stage("stage1", **changes)


def test_a_law_needs_a_stage_and_a_time_step():
    with pytest.raises(ConfigurationError, match="no stage"):
        AugmentedErrorLaw([], DT)
    with pytest.raises(ConfigurationError, match="dt"):
        AugmentedErrorLaw(both(), 0.0)
    with pytest.raises(ConfigurationError, match="stage3 is unknown"):
        AugmentedErrorGains.for_stage("stage3")
