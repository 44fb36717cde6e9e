"""The simulated hand: passive when it holds, on its way when it moves."""

import math

import numpy as np
import pytest
from plants import flexible

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.hardware import OmniRobot, OmniSettings
from haptic_teleop_sim.operators import Hand, Operator, grip_model


def operator(mode, **hand):
    return Operator(mode, tuple(Hand(**hand) for _ in range(3)))


def angles(robot, n, efforts=(0.0, 0.0, 0.0)):
    found = np.empty((n, 3))
    for k in range(n):
        found[k] = [robot.plants.state(i)[0] for i in range(3)]
        robot.sense()
        robot.step(efforts)
    return found


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("stiffness", [0.5, 3.0, 40.0])
def test_a_hand_that_holds_only_takes_energy(rate, stiffness):
    """However slow the sampling: its spring and damper are inside the dynamics."""
    hand = {"stiffness": stiffness, "damping": 1e-3, "inertia": 1e-3}
    robot = OmniRobot(OmniSettings(operator=operator("hold", **hand)), 1.0 / rate)
    plant = robot.plants.state(2)
    plant[2] = 2.0
    inertia = 6.52e-4 + 1e-3
    stored = []
    for _ in range(round(rate)):
        stored.append(0.5 * inertia * plant[2] ** 2 + 0.5 * stiffness * plant[0] ** 2)
        robot.step((0.0, 0.0, 0.0))
    assert np.all(np.diff(stored) <= 1e-9 * stored[0])
    assert stored[-1] < 0.2 * stored[0]


def test_a_hand_holds_y_against_the_device_s_own_spring():
    robot = OmniRobot(OmniSettings(operator=operator("hold", stiffness=3.0, posture=0.2)))
    y = angles(robot, 3000)[-1, 1]
    balance = (3.0 * 0.2 + 0.1173 * math.radians(38.0)) / (3.0 + 0.1173)
    assert y == pytest.approx(balance, abs=0.03 / 3.0)  # within what friction holds


def test_nobody_s_hand_changes_nothing():
    alone, none = OmniRobot(), OmniRobot(OmniSettings(operator=operator("none", stiffness=50.0, posture=0.5)))
    np.testing.assert_array_equal(angles(alone, 300, (0.1, 0.1, 0.1)), angles(none, 300, (0.1, 0.1, 0.1)))


def torque_of_target(times, points, t):
    """The hand's own torque per stiffness is its target."""
    op = operator("trajectory", times=times, angles=points, stiffness=1.0, damping=0.0)
    return op.torques(np.asarray(t, dtype=float))[:, 0]


def test_the_way_between_via_points_is_that_of_minimum_jerk():
    """The quintic is fixed by rest (speed and acceleration zero) at both ends."""
    t = np.linspace(1.0, 3.0, 201)
    rows = []
    for when in (0.0, 1.0):
        rows += [
            [when**k for k in range(6)],
            [k * when ** max(k - 1, 0) for k in range(6)],
            [k * (k - 1) * when ** max(k - 2, 0) for k in range(6)],
        ]
    coefficients = np.linalg.solve(np.array(rows), [0.1, 0, 0, 0.5, 0, 0])
    expected = np.polynomial.polynomial.polyval((t - 1.0) / 2.0, coefficients)
    np.testing.assert_allclose(torque_of_target((1.0, 3.0), (0.1, 0.5), t), expected, atol=1e-12)


def test_the_hand_waits_before_the_first_and_rests_after_the_last_via_point():
    got = torque_of_target((1.0, 2.0, 4.0), (0.1, 0.5, -0.2), [0.0, 0.99, 2.0, 4.0, 5.0, 100.0])
    np.testing.assert_allclose(got, [0.1, 0.1, 0.5, -0.2, -0.2, -0.2], atol=1e-12)


def test_the_damping_acts_on_the_rate_of_the_way():
    t = np.linspace(0.0, 2.5, 2501)
    way = {"times": (0.5, 2.0), "angles": (0.0, 0.4)}
    damped = operator("trajectory", **way, stiffness=0.0, damping=1.0).torques(t)[:, 0]
    way = torque_of_target((0.5, 2.0), (0.0, 0.4), t)
    np.testing.assert_allclose(damped, np.gradient(way, t), atol=1e-5)


def test_hands_with_different_numbers_of_via_points_do_not_disturb_each_other():
    hands = (Hand(times=(0.0,), angles=(0.1,)), Hand(times=(0.0, 1.0, 2.0), angles=(0.0, 0.2, 0.3)), Hand())
    t = np.linspace(0.0, 3.0, 50)
    together = Operator("trajectory", hands).torques(t)
    for i, hand in enumerate(hands):
        np.testing.assert_array_equal(together[:, i], Operator("trajectory", (hand,)).torques(t)[:, 0])


def test_the_device_follows_the_hand():
    op = operator("trajectory", times=(0.2, 1.5), angles=(0.0, 0.4), stiffness=20.0, damping=0.2)
    path = angles(OmniRobot(OmniSettings(operator=op)), 2000)
    t = 1e-3 * np.arange(2000)
    target = torque_of_target((0.2, 1.5), (0.0, 0.4), t)
    for axis in (0, 2):
        np.testing.assert_allclose(path[:, axis], target, atol=0.03)


def test_a_hand_on_a_flexible_axis_grips_the_arm():
    gripped = grip_model(flexible(), Hand(inertia=0.01, damping=0.3, stiffness=5.0))
    assert gripped.parameters["arm_inertia"] == pytest.approx(0.18)
    assert gripped.parameters["arm_damping"] == pytest.approx(0.32)
    assert gripped.parameters["motor_inertia"] == flexible().parameters["motor_inertia"]
    assert gripped.parameter_values()["stage1_arm.spring_to_ground.stiffness"] == 5.0


def test_bad_hands_are_refused():
    with pytest.raises(ConfigurationError, match="as many of both"):
        Hand(times=(0.0, 1.0), angles=(0.0,))
    with pytest.raises(ConfigurationError, match="do not increase"):
        Hand(times=(1.0, 1.0), angles=(0.0, 0.1))
    with pytest.raises(ConfigurationError, match="damping"):
        Hand(damping=-1.0)
    with pytest.raises(ConfigurationError, match=r"operator\.mode"):
        Operator("holds")
