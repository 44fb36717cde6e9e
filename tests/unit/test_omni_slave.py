"""The Omni as slave: the torque observer against an axis integrated here, the law against its equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import bilinear, lfilter

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LawResult
from haptic_teleop_control.laws.omni_slave import OmniSlaveLaw, OmniSlaveSettings
from haptic_teleop_control.parameters import ParameterTable

DT = 0.001
AXES = ("omni_y", "omni_z")
J, FV, FC, FCS, ALPHA, BETA = 2.526e-3, 2.0e-3, 0.02, 0.01, 5.0, 50.0
SPRING, REST = 0.1173, math.radians(38.0)
WC, ZETA = 2.0 * math.pi * 40.0, 0.9


def friction(v):
    """Equation (22)."""
    return FV * v + (FC + FCS / np.cosh(ALPHA * v)) * np.tanh(BETA * v)


def axis(torque, environment, duration):
    """Angle and velocity of omni_y, integrated by scipy; both torques are functions of time, the motor's is
    held over each sample."""

    def rate(t, x):
        held = torque(math.floor(t / DT + 1e-9) * DT)
        accelerating = held - SPRING * (x[0] - REST) - friction(x[1]) - environment(t)
        return [x[1], accelerating / J]

    times = np.arange(round(duration / DT) + 1) * DT
    found = solve_ivp(rate, (0.0, times[-1]), [REST, 0.0], t_eval=times, max_step=DT, rtol=1e-8, atol=1e-10)
    return times, found.y[0]


def filtered_velocity(position):
    b, a = bilinear([WC**2, 0.0], [1.0, 2.0 * ZETA * WC, WC**2], fs=1.0 / DT)
    return lfilter(b, a, position - position[0])


def estimates(law, times, position, torque):
    velocity = filtered_velocity(position)
    found = []
    for k, t in enumerate(times):
        applied = torque(t - DT) if k else torque(0.0)
        law.step([0.0], [position[k]], [velocity[k]], [applied])
        found.append(law.environment_torque[0])
    return np.array(found)


def observer(**changes):
    return OmniSlaveLaw([OmniSlaveSettings.for_axis("omni_y", **changes)], DT)


def test_motion_by_the_motor_alone_is_no_environment():
    """Accelerations of 60 rad/s², reversals, friction and spring leave less than 4 mN·m in the estimate."""

    def torque(t):
        return 0.12 * math.sin(9.0 * t) + 0.06 * math.sin(23.0 * t + 1.0)

    times, position = axis(torque, lambda t: 0.0, 2.0)
    assert np.ptp(position) > 0.3
    found = estimates(observer(), times, position, torque)
    assert np.sqrt(np.mean(found[100:] ** 2)) < 0.004


def test_a_torque_of_the_environment_is_found_after_the_observer_s_lag():
    def torque(t):
        return 0.15

    times, position = axis(torque, lambda t: 0.08 if t > 0.5 else 0.0, 0.8)
    found = estimates(observer(bandwidth=100.0), times, position, torque)
    assert abs(found[450:500].mean()) < 0.003
    assert found[-50:].mean() == pytest.approx(0.08, abs=0.003)
    # 1/bandwidth and the velocity filter's 2 zeta / wc, 17 ms together, until 63 %.
    risen = times[500 + int(np.argmax(found[500:] > 0.632 * 0.08))] - 0.5
    assert 0.010 < risen < 0.025


def test_at_rest_a_torque_below_the_breakaway_torque_is_the_blind_zone():
    """Nothing moves, so the torque may be carried by friction or by the environment."""
    for standstill, expected in ((0.0, 0.025), (1.0, 0.0), (0.4, 0.015)):
        law = observer(standstill=standstill)
        for _ in range(300):
            law.step([0.0], [REST], [0.0], [0.025])
        assert law.environment_torque[0] == pytest.approx(expected, abs=1e-6)
    law = observer(standstill=1.0)
    for _ in range(300):
        law.step([0.0], [REST], [0.0], [0.10])
    axis = law.settings[0]
    assert law.environment_torque[0] == pytest.approx(0.10 - (axis.coulomb + axis.stribeck), abs=1e-6)


def test_the_torque_is_that_of_equations_27_and_29():
    """Written down a second time, on an axis that stands at its spring's rest and never accelerates."""
    law = observer(kp=0.5, ki=3.0, lambda_=0.2, bandwidth=80.0)
    environment, integral = 0.0, 0.0
    share = 1.0 - math.exp(-80.0 * DT)
    for k in range(40):
        applied = 0.01 * math.sin(0.2 * k)
        if k == 0:
            smooth = lag = applied
            rate = 0.0
        else:  # the velocity filter without its derivative, in fine steps of Euler, input a straight line
            for i in range(200):
                u = lag + (applied - lag) * (i + 0.5) / 200
                rate += (WC**2 * (u - smooth) - 2.0 * ZETA * WC * rate) * DT / 200
                smooth += rate * DT / 200
            lag = applied
        environment += share * (smooth - environment)
        s = 0.1 - environment
        integral += 3.0 * s * DT
        torque = law.step([0.1], [REST], [0.0], [applied])
        assert law.environment_torque[0] == pytest.approx(environment, abs=2e-5)
        assert torque[0] == pytest.approx(environment + 0.5 * s + integral, abs=5e-5)
        assert law.augmented_error[0] == pytest.approx(s, abs=2e-5)


def test_the_limit_holds_and_the_integral_does_not_wind_up_behind_it():
    law = observer(torque_limit=0.1, kp=0.0, ki=10.0)
    for _ in range(2000):
        torque = law.step([1.0], [REST], [0.0], [0.0])
    assert torque[0] == 0.1
    assert law.results[0] == LawResult.SATURATED
    back = law.step([-0.1], [REST], [0.0], [0.0])
    assert back[0] < 0.1
    assert law.results[0] == LawResult.OK


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308])
def test_an_input_that_is_no_number_gives_no_torque_and_is_forgotten(place, value):
    law, other = observer(), observer()
    inputs = [[0.05], [REST], [0.1], [0.02]]
    for one in (law, other):
        for _ in range(5):
            one.step(*inputs)
    bad = [list(part) for part in inputs]
    bad[place] = [value]
    torque = law.step(*bad)
    assert math.isfinite(torque[0]) and abs(torque[0]) <= 0.446
    if not math.isfinite(value):
        assert torque[0] == 0.0
        assert law.results[0] == LawResult.REFUSED_INPUT
        assert law.step(*inputs)[0] == other.step(*inputs)[0]


def test_a_disabled_axis_gives_nothing_and_goes_on_observing():
    law = OmniSlaveLaw([OmniSlaveSettings.for_axis(axis) for axis in AXES], DT)
    law.enabled[0] = False
    for _ in range(200):
        torque = law.step([0.1, 0.1], [REST, 0.0], [0.0, 0.0], [0.06, 0.06])
    assert torque[0] == 0.0 and torque[1] > 0.06
    np.testing.assert_allclose(law.environment_torque, 0.06, atol=1e-4)
    assert list(law.results) == [LawResult.DISABLED, LawResult.OK]


def test_opposite_inputs_give_opposite_torques():
    one = OmniSlaveLaw([OmniSlaveSettings()], DT)
    two = OmniSlaveLaw([OmniSlaveSettings()], DT)
    random = np.random.default_rng(3)
    for _ in range(200):
        inputs = [random.normal(scale=0.1, size=1) for _ in range(4)]
        assert one.step(*inputs)[0] == -two.step(*[-part for part in inputs])[0]


def test_the_parameters_name_axis_and_gain_and_know_the_axis():
    table = ParameterTable("node", OmniSlaveLaw.parameters(AXES))
    values = table.check({"omni_z.slave.kp": 0.3})
    law = OmniSlaveLaw.from_parameters(values, AXES, DT)
    assert law.settings[1].kp == 0.3
    assert law.settings[0].spring == SPRING and law.settings[1].spring == 0.0
    assert law.settings[0].inertia > 3.0 * law.settings[1].inertia
    with pytest.raises(ConfigurationError, match=r"omni_y\.slave\.lambda"):
        law.update({"omni_y.slave.lambda": 0.0}, AXES)
    assert law.settings[0].lambda_ == OmniSlaveSettings.for_axis("omni_y").lambda_


def test_a_change_of_gains_in_contact_does_not_move_the_torque():
    law = observer(kp=0.4, ki=2.0)
    applied = 0.1
    for _ in range(4000):
        applied = law.step([0.1], [REST], [0.0], [applied])[0]
    law.settings = [OmniSlaveSettings.for_axis("omni_y", kp=0.8, ki=8.0)]
    assert law.step([0.1], [REST], [0.0], [applied])[0] == pytest.approx(applied, abs=1e-5)


def test_nonsense_is_refused_in_words():
    with pytest.raises(ConfigurationError, match="omni_x"):
        OmniSlaveSettings.for_axis("omni_x")
    with pytest.raises(ConfigurationError, match="dt is 0"):
        OmniSlaveLaw([OmniSlaveSettings()], 0.0)
    with pytest.raises(ConfigurationError, match="no axis"):
        OmniSlaveLaw([], DT)
