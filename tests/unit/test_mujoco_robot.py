"""A 2DSFJ made of MuJoCo's hinges, tendon, limits and actuators moves as the contract says, for every effect
that it has words for."""

import sys

import numpy as np
import pytest

from haptic_teleop_control.errors import ConfigurationError, ModelError
from haptic_teleop_sim import mujoco_robot
from haptic_teleop_sim.experiments import run_closed_loop
from haptic_teleop_sim.hardware import SfjRobot, SfjSettings, stage_hardware
from haptic_teleop_sim.lockstep import check_scenario, simulate_scenario
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.mujoco_effects import unexpressed
from haptic_teleop_sim.mujoco_robot import MujocoRobot
from haptic_teleop_sim.step_result import StepResult

THESIS = {"torque_constant": 8.925, "stiffness": 3.971, "motor_inertia": 0.0635, "motor_damping": 2.6,
          "arm_inertia": 0.17, "arm_damping": 0.02}  # fmt: skip
EFFECTS = [
    ("coulomb_friction", "motor", {"torque": 0.4}),
    ("coulomb_friction", "arm", {"torque": 0.1}),
    ("quadratic_drag", "motor", {"coefficient": 2.0}),
    ("quadratic_drag", "arm", {"coefficient": 0.5}),
    ("spring_to_ground", "motor", {"stiffness": 2.0, "rest": 0.1}),
    ("spring_to_ground", "arm", {"stiffness": 1.0, "rest": -0.1}),
    ("constant_torque", "motor", {"torque": 0.1}),
    ("constant_torque", "arm", {"torque": 0.1}),
    ("gravity", "arm", {"torque": 0.5, "phase": 0.6}),
    ("hard_stop", "motor", {"angle": -0.2, "stiffness": 100.0, "dissipation": 1.0, "both_sides": 1.0}),
    ("hard_stop", "arm", {"angle": 0.3, "stiffness": 100.0}),
    ("backlash", "joint", {"width": 0.1}),
    ("hardening_spring", "joint", {"cubic": 40.0}),
    ("joint_damping", "joint", {"coefficient": 0.3}),
    ("extra_flexible_mode", "arm", {"frequency": 2.0, "inertia": 0.05}),
    ("actuator_lag", "actuator", {"time_constant": 0.05}),
    ("torque_saturation", "actuator", {"limit": 0.9}),
    ("input_delay", "actuator", {"delay": 0.0331}),
    ("dead_zone", "actuator", {"width": 0.3}),
    ("payload_change", "arm", {"time": 1.5, "inertia": 0.1}),
]
MUJOCO = pytest.mark.skipif(not mujoco_robot.mujoco_installed(), reason="MuJoCo is not installed")


def settings(*effects):
    model = Model("sfj", "stage1", "flexible_joint", THESIS, effects=effects)
    quiet = {"sense_noise": 0.0, "sense_offset": 0.0}
    return SfjSettings(stage_hardware("stage1", model, **quiet), stage_hardware("stage2", **quiet))


def driven(robot, seconds=3.0):
    """Stage 1 follows a current of three sines, stage 2 rests."""

    def effort(time, position, velocity, effort):
        sines = np.sin(2.0 * np.pi * np.array([0.4, 1.1, 2.3]) * time + np.array([0.0, 1.0, 2.0]))
        return [8.925 * 0.17 * float(sines @ [1.0, 0.7, 0.5]), 0.0]

    return run_closed_loop(robot, effort, seconds)["/sfj/joint_states"]


@pytest.fixture(scope="module")
def without():
    """Positions of stage 1 in MuJoCo without any effect."""
    return driven(MujocoRobot(settings())).position[:, :2]


@MUJOCO
@pytest.mark.parametrize(("effect", "place", "values"), EFFECTS)
def test_an_effect_moves_the_arm_in_mujoco_as_in_the_projects_own_simulator(effect, place, values, without):
    one = Effect(effect, f"stage1_{place}", values)
    ours, theirs = (
        driven(robot).position[:, :2] for robot in (SfjRobot(settings(one)), MujocoRobot(settings(one)))
    )
    difference = np.sqrt(np.mean((ours - theirs) ** 2, axis=0))
    # Two integrators and two ideas of dry friction differ by less than a tenth of what the effect does.
    assert np.all(difference < 0.1 * np.sqrt(np.mean((theirs - without) ** 2, axis=0)).max())
    assert np.all(difference < 0.01 * np.std(theirs, axis=0))


@MUJOCO
def test_the_signals_are_those_of_the_other_plant():
    ours, theirs = (driven(robot, 2.0) for robot in (SfjRobot(settings()), MujocoRobot(settings())))
    assert theirs.names == ours.names
    np.testing.assert_array_equal(theirs.stamp, ours.stamp)
    steps = np.array([1.5339807878856413e-05, 0.00024622484556751864])
    counts = theirs.position[:, :2] / steps
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    np.testing.assert_allclose(theirs.velocity, ours.velocity, atol=0.02 * np.max(np.abs(ours.velocity)))
    np.testing.assert_allclose(theirs.effort, ours.effort, atol=0.01)


@MUJOCO
def test_commands_are_limited_and_what_is_no_number_is_refused():
    robot = MujocoRobot(settings())
    robot.sense()
    assert robot.step([1e3, 0.0]) == StepResult.LIMITED
    assert robot.step([np.nan, 0.0]) == StepResult.REFUSED_COMMAND
    assert np.all(np.isfinite(robot.sense()[0]))


@MUJOCO
def test_scenario_1_reaches_the_wall_and_the_desired_torque_in_mujoco():
    plant = {"stage1.wall.angle": 1.0, "stage1.wall.dissipation": 1.0, "stage2.wall.angle": 1.0,
             "stage2.wall.dissipation": 1.0}  # fmt: skip
    steps = {"stage1.enabled": True, "stage1.step.enabled": True, "stage1.step.amplitude": 0.06}
    gains = {"omni_y.torque_gain": 10.0, "stage1.lambda": 0.5}
    scenario = check_scenario({"sfj_sim": plant, "signal_generator": steps, "force_controller": gains})
    robot = MujocoRobot.from_parameters(plant)
    states = simulate_scenario(scenario, 5.0, slave=robot).topics["/sfj/joint_states"]
    settled = slice(-200, None)
    assert np.mean(states.signal("stage1_arm", "position")[settled]) == pytest.approx(1.0, abs=0.005)
    assert np.mean(states.signal("stage1_arm", "effort")[settled]) == pytest.approx(0.6, rel=0.03)


def test_an_effect_without_words_is_refused_by_name():
    ripple = Effect("torque_ripple", "stage1_motor", {"amplitude": 0.1, "order": 8.0})
    assert unexpressed(settings(ripple).stage1.model) == [ripple]
    with pytest.raises(ModelError, match=r"torque_ripple at stage1_motor.*sfj_sim"):
        MujocoRobot(settings(ripple))


def test_without_mujoco_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ConfigurationError, match=r"pip install mujoco.*sfj_sim"):
        MujocoRobot(settings())
