"""The 2DSFJ as master: what is read from the hand, and how the drive gives the feedback back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LawResult
from haptic_teleop_control.laws.sfj_master import SfjMasterSettings, SfjMasterSide
from haptic_teleop_control.parameters import ParameterTable

DT = 0.002
STAGES = ("stage1", "stage2")


def side(**changes):
    return SfjMasterSide([SfjMasterSettings.for_stage("stage1", **changes)], DT)


def test_a_hand_that_pushes_counter_clockwise_asks_for_a_positive_torque():
    """T_h = Ks (theta_a - theta_m) is minus the effort of the arm, Te = Ks (theta_m - theta_a)."""
    master = side(torque_gain=0.2, dead_zone=0.02)
    te = 3.971 * (0.0 - 0.1)  # the arm is pushed 0.1 rad ahead of the drive
    assert master.desired([te])[0] == pytest.approx(0.2 * (0.3971 - 0.02))
    assert master.desired([-te])[0] == pytest.approx(-0.2 * (0.3971 - 0.02))


def test_what_the_encoders_disagree_by_asks_for_nothing():
    master = side(torque_gain=0.5, dead_zone=0.02)
    for te in (-0.0199, 0.0, 0.0137):
        assert master.desired([te])[0] == 0.0


def test_the_desired_torque_keeps_its_limit():
    assert side(torque_gain=1.0, desired_torque_limit=0.15).desired([-5.0])[0] == 0.15


def test_the_drive_holds_its_neutral_place_by_equation_32():
    master = side(kpm=20.0, kdm=0.2, neutral=0.0)
    master.step([0.0], [0.0], [0.0])
    current = master.step([0.01], [0.5], [0.0])
    assert current[0] == pytest.approx(-20.0 * 0.01 - 0.2 * 0.5)


def test_feedback_draws_the_drive_back_so_that_the_hand_feels_just_that_torque_more():
    """A drive in its place and an arm held still: the joint is deflected by gain x Te / Ks more."""
    master = side(feedback_gain=1.5, kpm=40.0, kdm=0.0)
    master.step([0.0], [0.0], [0.0])
    place = -1.5 * 0.08 / 3.971
    assert master.step([place], [0.0], [0.08])[0] == pytest.approx(0.0, abs=1e-12)
    felt = 3.971 * (0.0 - place)
    assert felt == pytest.approx(1.5 * 0.08)
    # A resisting torque of 0.02 N·m along with a Te that the feedback would give as -0.02: they cancel.
    assert master.step([0.0], [0.0], [-0.02 / 1.5], [0.02])[0] == pytest.approx(0.0, abs=1e-12)


def test_feedback_moves_the_drive_no_further_than_its_travel():
    master = side(feedback_gain=1.0, travel=0.05, kpm=10.0, kdm=0.0)
    master.step([0.0], [0.0], [0.0])
    assert master.step([0.0], [0.0], [100.0])[0] == pytest.approx(-10.0 * 0.05)


def test_a_drive_far_from_neutral_goes_there_at_the_return_speed_and_without_a_jump():
    master = side(kpm=10.0, kdm=0.0, return_speed=0.2)
    assert master.step([0.5], [0.0], [0.0])[0] == pytest.approx(-10.0 * 0.2 * DT)
    angle = 0.5
    angles = []
    for _ in range(2000):
        angle += 0.5 * master.step([angle], [0.0], [0.0])[0] * 0.1  # a drive that follows slowly
        angles.append(angle)
    speed = -np.diff(angles) / DT
    assert speed[200:1000].mean() == pytest.approx(0.2, rel=0.05)
    assert abs(angles[-1]) < 0.02


def test_the_current_limit_holds_and_is_said():
    master = side(kpm=60.0)
    master.step([0.0], [0.0], [0.0])
    assert master.step([-1.0], [0.0], [0.0])[0] == 0.94
    assert master.results[0] == LawResult.SATURATED


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_an_input_that_is_no_number_gives_no_current_and_is_forgotten(place, value):
    one, two = (
        side(feedback_gain=1.0, feedback_cutoff_hz=5.0),
        side(feedback_gain=1.0, feedback_cutoff_hz=5.0),
    )
    inputs = [[0.01], [0.1], [0.05], [0.0]]
    for master in (one, two):
        for _ in range(5):
            master.step(*inputs)
    bad = [list(part) for part in inputs]
    bad[place] = [value]
    assert one.step(*bad)[0] == 0.0
    assert one.results[0] == LawResult.REFUSED_INPUT
    assert one.step(*inputs)[0] == two.step(*inputs)[0]


def test_the_hand_on_a_real_drive_feels_the_feedback():
    """Drive with inertia, viscous and Coulomb friction, integrated by scipy between the samples; the hand
    holds the arm. What it feels more is the feedback, within what friction leaves of the drive's place."""
    ks, kt, inertia, damping, coulomb = 3.971, 8.925, 0.0635, 2.6, 0.6
    master = side(feedback_gain=1.0)
    x, felt = np.zeros(2), []
    for k in range(1000):
        te = 0.12 if k >= 250 else 0.0
        torque = kt * master.step([x[0]], [x[1]], [te])[0]

        def rate(t, x, torque=torque):
            friction = damping * x[1] + coulomb * math.tanh(200.0 * x[1])
            return [x[1], (torque - friction - ks * x[0]) / inertia]

        x = solve_ivp(rate, (0.0, DT), x, rtol=1e-6, atol=1e-9).y[:, -1]
        felt.append(-ks * x[0])
    assert abs(felt[240]) < 0.002
    assert felt[-1] == pytest.approx(0.12, abs=coulomb / kt / 60.0 * ks + 0.002)
    assert max(felt) < 1.1 * 0.12


def test_gains_that_would_let_contact_feed_itself_are_refused():
    with pytest.raises(ConfigurationError, match="product below 1"):
        SfjMasterSettings(torque_gain=0.5, feedback_gain=2.0)
    table = ParameterTable("node", SfjMasterSide.parameters(STAGES))
    values = table.check({"stage2.master.torque_gain": 1.0, "stage2.master.feedback_gain": 1.0})
    with pytest.raises(ConfigurationError, match=r"stage2\.master\.feedback_gain"):
        SfjMasterSide.from_parameters(values, STAGES, DT)


def test_parameters_know_the_stage_and_change_while_running():
    table = ParameterTable("node", SfjMasterSide.parameters(STAGES))
    master = SfjMasterSide.from_parameters(table.check({}), STAGES, DT)
    np.testing.assert_allclose(master.torque_constant, [8.925, 1.392])
    master.update(table.check({"stage1.master.torque_gain": 0.4}), STAGES)
    assert master.settings[0].torque_gain == 0.4
    with pytest.raises(ConfigurationError, match=r"stage1\.master\.kpm"):
        master.update({"stage1.master.kpm": 0.0}, STAGES)
    assert master.settings[0].torque_gain == 0.4


def test_a_feedback_gain_changed_by_parameter_takes_hold_without_a_jump():
    table = ParameterTable("node", SfjMasterSide.parameters(STAGES))
    master = SfjMasterSide.from_parameters(table.check({}), STAGES, DT)
    still = [[0.0, 0.0], [0.0, 0.0], [0.2, 0.2]]
    master.step(*still)
    master.update(table.check({"stage1.master.feedback_gain": 1.0}), STAGES)
    currents = np.array([master.step(*still)[0] for _ in range(150)])
    assert currents[-1] == -0.94  # the limit: the drive does not follow here
    assert np.abs(np.diff(currents)).max() < 0.05
