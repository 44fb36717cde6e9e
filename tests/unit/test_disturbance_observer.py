"""The law with observers at both ends of the joint: what it promises in free motion and at a wall, on a joint
whose motion is the matrix exponential's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import DisturbanceObserverLaw, DisturbanceObserverSettings

DT = 0.002
DAMPING = {"stage1": (2.6, 0.02), "stage2": (0.6, 0.005)}
INERTIA = {"stage1": (0.0635, 0.17), "stage2": (0.00704, 0.0064)}


def law_of(stage, **changes):
    return DisturbanceObserverLaw([DisturbanceObserverSettings.for_stage(stage, **changes)], DT)


class Joint:
    """Two masses and a spring between them, moved exactly under a held current; `wall`: a damped spring that
    the arm sticks to, `disturbance`: a constant torque at the drive."""

    def __init__(self, stage, motor_damping=None, wall=0.0, disturbance=0.0, inertia=None):
        settings = DisturbanceObserverSettings.for_stage(stage)
        self.stiffness = settings.stiffness
        motor_inertia, arm_inertia = inertia or INERTIA[stage]
        b1, b2 = DAMPING[stage]
        b1 = b1 if motor_damping is None else motor_damping
        b2 += 2.0 * (wall > 0.0)
        a = np.zeros((6, 6))
        a[0, 2] = a[1, 3] = 1.0
        a[2, :4] = np.array([-self.stiffness, self.stiffness, -b1, 0.0]) / motor_inertia
        a[3, :4] = np.array([self.stiffness, -self.stiffness - wall, 0.0, -b2]) / arm_inertia
        a[2, 4] = settings.torque_constant / motor_inertia
        a[2, 5] = 1.0 / motor_inertia
        step = expm(a * DT)
        self.transition, self.input = step[:4, :4], step[:4, 4]
        self.constant = step[:4, 5] * disturbance
        self.state = np.zeros(4)

    def run(self, law, desired, seconds):
        """States (n, 4) and currents (n,)."""
        states, currents = [], []
        for _ in range(round(seconds / DT)):
            motor, arm, speed, _ = self.state
            current = law.step([desired], [motor], [arm], [speed])[0]
            states.append(self.state)
            currents.append(current)
            self.state = self.transition @ self.state + self.input * current + self.constant
        return np.array(states), np.array(currents)


@pytest.mark.parametrize(("stage", "desired"), [("stage1", 0.6), ("stage2", 0.5), ("stage1", -0.3)])
def test_free_motion_reaches_desired_torque_over_lambda_though_the_arm_has_damping(stage, desired):
    states, _ = Joint(stage).run(law_of(stage), desired, 8.0)
    assert states[-1, 2] == pytest.approx(desired / 0.5, rel=1e-3)
    assert states[-1, 3] == pytest.approx(desired / 0.5, rel=1e-3)


def test_free_motion_of_the_first_stage_is_that_of_the_augmented_error_held_at_zero():
    # s = 0 makes of drive and spring a damper lambda: lambda th1' + Ks (th1 - th2) = Td (the arm undamped).
    law = law_of("stage1", arm_damping=0.0)
    joint = Joint("stage1")
    states, _ = joint.run(law, 0.4, 3.0)
    a = np.array([[-joint.stiffness / 0.5, joint.stiffness / 0.5, 0.0, 0.4 / 0.5],
                  [0.0, 0.0, 1.0, 0.0],
                  [joint.stiffness / 0.17, -joint.stiffness / 0.17, -0.02 / 0.17, 0.0],
                  [0.0, 0.0, 0.0, 0.0]])  # fmt: skip
    step, ideal = expm(a * DT), [np.array([0.0, 0.0, 0.0, 1.0])]
    for _ in range(len(states) - 1):
        ideal.append(step @ ideal[-1])
    ideal = np.array(ideal)
    # The drive needs some milliseconds to follow, in which it falls behind by a few hundredths of a radian.
    assert np.max(np.abs(states[:, 1] - ideal[:, 1])) < 0.03
    assert np.max(np.abs(states[1000:, 3] - ideal[1000:, 2])) < 0.005


@pytest.mark.parametrize("disturbance", [-0.6, 0.4])
@pytest.mark.parametrize("motor_damping", [1.3, 3.9])
def test_neither_a_torque_at_the_drive_nor_a_wrong_damping_changes_the_speed(disturbance, motor_damping):
    joint = Joint("stage1", motor_damping=motor_damping, disturbance=disturbance)
    states, _ = joint.run(law_of("stage1"), 0.5, 8.0)
    assert states[-1, 2] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("wall", [5.0, 100.0, 2000.0])
@pytest.mark.parametrize(("stage", "desired"), [("stage1", 0.6), ("stage2", -0.8)])
def test_contact_settles_at_the_desired_torque_with_the_same_settings(stage, desired, wall):
    joint = Joint(stage, wall=wall)
    states, _ = joint.run(law_of(stage), desired, 6.0)
    torque = joint.stiffness * (states[:, 0] - states[:, 1])
    assert torque[-1] == pytest.approx(desired, rel=1e-3)
    assert wall * states[-1, 1] == pytest.approx(desired, rel=1e-3)
    assert np.max(torque / desired) < 1.05


@pytest.mark.parametrize("share", [0.7, 1.3])
def test_all_model_parameters_off_by_thirty_percent_leave_the_loop_stable_and_exact(share):
    for stage, desired in (("stage1", 0.5), ("stage2", 0.3)):
        inertia = tuple(share * value for value in INERTIA[stage])
        free, _ = Joint(stage, inertia=inertia).run(law_of(stage), desired, 10.0)
        assert free[-1, 3] == pytest.approx(desired / 0.5, rel=1e-3)
        joint = Joint(stage, wall=500.0, inertia=inertia)
        states, _ = joint.run(law_of(stage), desired, 6.0)
        assert joint.stiffness * (states[-1, 0] - states[-1, 1]) == pytest.approx(desired, rel=1e-3)


def test_a_command_taken_back_stops_the_arm():
    joint, law = Joint("stage1"), law_of("stage1")
    joint.run(law, 0.6, 4.0)
    states, _ = joint.run(law, 0.0, 4.0)
    assert np.all(np.abs(states[-1, 2:]) < 1e-3)


def test_a_small_command_against_the_motion_brakes_as_hard_as_s_demands():
    # From -1.2 rad/s: Td/lambda is 0.1, and the arm must not coast as if only 0.05 N·m might brake it.
    joint, law = Joint("stage1"), law_of("stage1")
    joint.run(law, -0.6, 4.0)
    states, _ = joint.run(law, 0.05, 1.2)
    assert states[-1, 3] > 0.0


def test_a_change_of_settings_in_steady_contact_does_not_move_the_current():
    joint, law = Joint("stage1", wall=2000.0, disturbance=-0.4), law_of("stage1")
    _, currents = joint.run(law, 0.6, 6.0)
    law.settings = [
        DisturbanceObserverSettings.for_stage(
            "stage1", torque_constant=6.0, contact_rate=20.0, contact_memory=0.3, contact_sense=0.1,
            motor_rate=60.0, motor_inertia=0.1, motor_damping=1.0, arm_inertia=0.1, lambda_=0.8,
        )
    ]  # fmt: skip
    motor, arm, speed, _ = joint.state
    assert law.step([0.6], [motor], [arm], [speed])[0] == pytest.approx(currents[-1], rel=2e-3)


def test_the_law_starts_without_a_jolt_on_a_joint_that_is_somewhere_and_moves():
    law = law_of("stage1", lambda_=0.5)
    # At 1 rad/s with the command that belongs to it; the current is then what the drive's damping needs.
    current = law.step([0.5], [0.8], [0.8 - 0.02 / 3.971], [1.0])[0]
    assert current == pytest.approx((2.6 + 0.02) / 8.925, rel=0.02)


def test_an_arm_damping_that_leaves_no_lambda_is_refused():
    with pytest.raises(ConfigurationError, match=r"observer\.arm_damping is 0\.5.*below lambda, 0\.5"):
        DisturbanceObserverSettings.for_stage("stage1", arm_damping=0.5)
    with pytest.raises(ConfigurationError, match=r"stage2\.observer\.caution is 2"):
        DisturbanceObserverLaw.from_parameters({"stage2.observer.caution": 2.0}, ["stage1", "stage2"], DT)


def test_parameters_changed_in_free_motion_lead_to_the_new_speed_without_a_jump():
    stages = ("stage1",)
    largest = {}
    for way in ("update", "assign"):
        joint, law = Joint("stage1"), law_of("stage1")
        _, before = joint.run(law, 0.5, 4.0)
        if way == "update":
            law.update({"stage1.lambda": 1.0}, stages)
        else:
            law.settings = [DisturbanceObserverSettings.for_stage("stage1", lambda_=1.0)]
        states, currents = joint.run(law, 0.5, 6.0)
        largest[way] = np.max(np.abs(np.diff(np.append(before[-1], currents))))
        assert states[-1, 3] == pytest.approx(0.5, rel=1e-3)
    assert largest["update"] < 0.05 * largest["assign"]


def test_a_limit_holds_as_soon_as_it_is_changed():
    law = law_of("stage1")
    law.step([0.0], [0.0], [0.0], [0.0])
    law.update({"stage1.current_limit": 0.1}, ("stage1",))
    assert law.step([5.0], [0.0], [0.0], [0.0])[0] == 0.1
