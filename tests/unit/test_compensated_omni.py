"""The horizontal Omni with its compensation: through the driver, and as the simulated twin."""

import sys
from pathlib import Path

import numpy as np
import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))
from device_rigs import OmniRig, StillOmni

from haptic_teleop_control.robots import OMNI_AXES
from haptic_teleop_sim.default_models import omni_axis_model
from haptic_teleop_sim.emulation import omni_plant
from haptic_teleop_sim.hardware import OmniRobot
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sim.model import Effect

ON = {
    "compensation.level.kp": 1.0, "compensation.level.ki": 4.0, "compensation.level.kd": 0.03,
    "compensation.spring": OMNI_AXES["omni_y"].spring_stiffness, "compensation.bias": 0.02,
    "compensation.ramp_time": 0.0,
}  # fmt: skip


def moved(robot: OmniRobot, seconds: float = 3.0) -> np.ndarray:
    """(time, 3) angles with a command of zero."""
    path = []
    for _ in range(round(seconds / robot.dt)):
        path.append(robot.sense()[0].copy())
        robot.step(np.zeros(3))
    return np.array(path)


def drifting(folder: Path) -> str:
    """A model of Z that drifts: a constant torque that its friction cannot hold."""
    model = omni_axis_model("omni_z")
    drifts = model.with_effects(Effect("constant_torque", "omni_z_motor", {"torque": -0.05}))
    drifts.save(folder / "drifting_z.yaml")
    return "drifting_z.yaml"


def test_without_compensation_y_is_pulled_away_and_x_stays_where_it_is_pushed(tmp_path):
    plain = OmniRobot.from_parameters(
        {"omni_x.initial_angle": 0.2, "omni_z.model": drifting(tmp_path)}, folder=tmp_path
    )
    end = moved(plain)[-1]
    assert end[0] == pytest.approx(0.2, abs=1e-3)
    assert end[1] > 0.3 and end[2] < -0.3


def test_with_it_x_is_level_y_rests_anywhere_and_z_does_not_drift(tmp_path):
    values = {**ON, "compensation.bias": 0.05, "omni_z.model": drifting(tmp_path)}
    for angle in (-0.5, 0.0, 0.5):
        robot = OmniRobot.from_parameters(
            {**values, "omni_x.initial_angle": 0.2, "omni_y.initial_angle": angle}, folder=tmp_path
        )
        end = moved(robot)[-1]
        assert abs(end[0]) < 0.01
        assert end[1] == pytest.approx(angle, abs=0.005)
        assert abs(end[2]) < 0.005


def test_the_effort_of_the_joint_states_holds_the_compensation():
    robot = OmniRobot.from_parameters({**ON, "omni_y.initial_angle": 0.3})
    robot.sense()
    robot.step(np.array([0.0, 0.01, 0.0]))
    _, _, effort = robot.sense()
    spring = OMNI_AXES["omni_y"]
    assert effort[1] == pytest.approx(0.01 + spring.spring_stiffness * (0.3 - spring.spring_rest), abs=1e-4)
    assert effort[2] == pytest.approx(0.02)


def test_a_device_that_is_not_commanded_is_not_compensated():
    robot = OmniRobot.from_parameters(ON)
    robot.sense()
    robot.powered = False
    robot.step(np.zeros(3))
    assert not robot.sense()[2].any()


def test_the_driver_adds_the_same_torques_within_the_steps_of_its_reports():
    angles = np.array([0.1, 0.3, -0.2])
    values = {name.replace(".", "__"): value for name, value in ON.items()}
    rig = OmniRig(StillOmni(angles), calibration__angles=angles.tolist(), **values)
    rig.run(5, [0.0, 0.0, 0.0])
    spring = OMNI_AXES["omni_y"]
    expected = [-0.1, spring.spring_stiffness * (0.3 - spring.spring_rest), 0.02]
    np.testing.assert_allclose(rig.plant.given[-1], expected, atol=3e-3)
    rig.run(2, None)  # no command: nothing flows
    assert not rig.plant.given[-1].any()
    rig.latch.count("silent")
    rig.run(2, [0.0, 0.0, 0.0])
    assert not rig.plant.given[-1].any()


def test_the_driver_s_limits_hold_for_command_and_compensation_together():
    rig = OmniRig(StillOmni(np.zeros(3)), compensation__bias=0.25, compensation__ramp_time=0.0)
    rig.run(5, [0.0, 0.0, 0.4])
    assert rig.plant.given[-1][2] <= 0.446


def test_driver_and_twin_move_the_same_arm_alike(tmp_path):
    """The same model behind the driver's reports and as the simulated robot, let go at an angle of X."""
    content = {"omni_sim": {"ros__parameters": {"omni_x": {"initial_angle": 0.2}}}}
    file = tmp_path / "plant.yaml"
    file.write_text(yaml.safe_dump(content))
    twin = moved(OmniRobot.from_parameters({**ON, "omni_x.initial_angle": 0.2}), 2.0)
    values = {name.replace(".", "__"): value for name, value in ON.items()}
    rig = OmniRig(omni_plant(str(file), 1000.0), calibration__angles=[0.2, 0.0, 0.0], **values)
    path = []
    for _ in range(2000):
        rig.cycle([0.0, 0.0, 0.0])
        path.append(rig.driver.position.copy())
    assert np.abs(np.array(path)[:, :2] - twin[:, :2]).max() < 0.02
    assert abs(path[-1][0]) < 0.01


def test_the_compiled_scenario_compensates_as_the_one_in_python_does():
    content = {
        "sfj_sim": {},
        "omni_sim": {**ON, "omni_x.initial_angle": 0.1},
        "force_controller": {},
        "signal_generator": {},
    }
    fast = run_scenario(content, 0.5)
    # A passivity controller that is on and has nothing to do takes the loop in Python.
    on = {"passivity.controller": True, "passivity.maximum_damping": 0.0}
    slow = run_scenario({**content, "force_controller": on}, 0.5)
    for topic in ("/omni/joint_states", "/omni/effort_command", "/sfj/joint_states"):
        np.testing.assert_array_equal(fast[topic].effort, slow[topic].effort)
    assert abs(fast["/omni/joint_states"].position[-1, 0]) < 0.05
