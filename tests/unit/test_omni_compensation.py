"""Compensation of the horizontal Omni: what each axis gets, and what becomes of the axes with it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.omni_compensation import COMPENSATION, CompensationSettings, OmniCompensation
from haptic_teleop_control.parameters import ParameterTable

DT = 0.001
LEVEL = {"kp": 1.0, "ki": 4.0, "kd": 0.03}


def compensation(**settings):
    return OmniCompensation(CompensationSettings(**{"ramp_time": 0.0, **settings}))


def test_nothing_set_is_no_torque():
    nothing = CompensationSettings()
    assert not nothing.active
    assert not OmniCompensation(nothing).step([0.3, -0.4, 0.2], [1.0, 1.0, 1.0], DT).any()


def test_each_axis_gets_its_own_torque():
    torque = compensation(kp=2.0, spring=0.1, spring_rest=0.5, bias=0.015).step(
        [0.05, -0.3, 0.2], [0.0] * 3, DT
    )
    np.testing.assert_allclose(torque, [-0.1, 0.1 * (-0.3 - 0.5), 0.015])


def test_the_counter_spring_cancels_the_spring_wherever_the_arm_is():
    one = compensation(spring=0.1173, spring_rest=0.66, limit=0.4)
    for angle in np.linspace(-0.87, 0.87, 9):
        assert one.step([0.0, angle, 0.0], [0.0] * 3, DT)[1] - 0.1173 * (angle - 0.66) == pytest.approx(0.0)


def test_x_comes_back_to_level_against_a_constant_load():
    """An axis of 1.8e-3 kg·m² under 0.05 N·m, integrated by scipy: the integral takes the load."""
    one = compensation(**LEVEL)
    x = np.array([0.1, 0.0])
    for _ in range(3000):
        torque = one.step([x[0], 0.0, 0.0], [x[1], 0.0, 0.0], DT)[0]

        def rate(t, x, torque=torque):
            return [x[1], (torque + 0.05 - 2e-3 * x[1]) / 1.8e-3]

        x = solve_ivp(rate, (0.0, DT), x, rtol=1e-6, atol=1e-9).y[:, -1]
    assert abs(x[0]) < 1e-3
    assert one.state[0] == pytest.approx(-0.05, abs=2e-3)


def test_it_ramps_in_and_again_after_a_rest():
    one = compensation(bias=0.02, ramp_time=0.1)
    torques = [one.step([0.0] * 3, [0.0] * 3, DT)[2] for _ in range(150)]
    np.testing.assert_allclose(torques[:100], 0.02 * np.arange(100) / 100, atol=1e-12)
    assert torques[-1] == pytest.approx(0.02)
    one.rest()
    assert one.step([0.0] * 3, [0.0] * 3, DT)[2] == 0.0


def test_no_axis_exceeds_the_limit_and_a_held_x_does_not_wind_up():
    one = compensation(kp=1.0, ki=50.0, spring=10.0, bias=5.0, limit=0.1)
    for _ in range(1000):
        torque = one.step([0.5, 0.5, 0.5], [0.0] * 3, DT)
        assert np.abs(torque).max() <= 0.1
    assert one.step([-0.2, 0.0, 0.0], [0.0] * 3, DT)[0] > 0.0  # turns at once when let go beyond level


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_angles_that_are_no_numbers_give_no_torque(bad):
    one = compensation(kp=1.0, ki=1.0, kd=1.0, spring=0.1)
    for position, velocity in (([bad, 0, 0], [0, 0, 0]), ([0, bad, 0], [0, 0, 0]), ([0, 0, 0], [bad, 0, 0])):
        assert not one.step(position, velocity, DT).any()
    assert np.isfinite(one.state).all()


def test_parameters_are_named_and_checked():
    values = ParameterTable("node", COMPENSATION).check({"compensation.level.kp": 0.7})
    assert OmniCompensation.from_parameters(values).settings.kp == 0.7
    with pytest.raises(ConfigurationError, match=r"file: compensation\.limit"):
        OmniCompensation.from_parameters({"compensation.limit": 9.0}, "file")
