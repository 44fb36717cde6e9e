"""Experiments on one robot: what identification records, without ROS or clock."""

import numpy as np
import pytest

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import read_recording, write_recording
from haptic_teleop_sim.experiments import PositionLoop, run_closed_loop, run_open_loop
from haptic_teleop_sim.hardware import OmniRobot, SfjRobot


def currents(n=800):
    t = 0.002 * np.arange(n)
    return np.column_stack([0.2 * np.sin(4.0 * t), 0.3 * np.sin(7.0 * t)])


def test_open_loop_is_sensing_and_stepping_sample_by_sample():
    robot, twin = SfjRobot(seed=2), SfjRobot(seed=2)
    effort = currents() * robot.torque_constants
    topics = run_open_loop(robot, effort)
    states = topics["/sfj/joint_states"]
    for k in range(len(effort)):
        position, velocity, measured = twin.sense()
        np.testing.assert_array_equal(states.position[k], position)
        np.testing.assert_array_equal(states.velocity[k], velocity)
        np.testing.assert_array_equal(states.effort[k], measured)
        twin.step(effort[k])
    np.testing.assert_array_equal(topics["/sfj/effort_command"].effort, effort)
    np.testing.assert_array_equal(robot.plants.states, twin.plants.states)


def test_an_experiment_goes_on_where_the_last_one_ended():
    whole, parts = SfjRobot(seed=2), SfjRobot(seed=2)
    effort = currents() * whole.torque_constants
    once = run_open_loop(whole, effort)["/sfj/joint_states"]
    first, second = (run_open_loop(parts, part)["/sfj/joint_states"] for part in (effort[:300], effort[300:]))
    np.testing.assert_array_equal(once.position, np.concatenate([first.position, second.position]))
    np.testing.assert_array_equal(once.effort, np.concatenate([first.effort, second.effort]))
    np.testing.assert_array_equal(once.stamp, np.concatenate([first.stamp, second.stamp]))


def test_an_environment_can_push():
    n = round(4 * 2 * np.pi * np.sqrt(0.17 / 3.971) / 0.002)  # four swings of the arm on its spring
    push = np.zeros((n, 2))
    push[:, 0] = 0.25
    arm = run_open_loop(SfjRobot(), np.zeros((n, 2)), push)["/sfj/joint_states"].position[:, 1]
    # The drive holds by its friction (0.6 N·m), so the arm swings about where the spring carries the push.
    assert arm.mean() == pytest.approx(0.25 / 3.971, rel=0.02)


def test_a_position_loop_takes_the_motors_to_their_target():
    robot = SfjRobot()
    loop = PositionLoop(robot, lambda t: (0.3, -0.2), kp=(40.0, 15.0), kd=(1.0, 0.3))
    states = run_closed_loop(robot, loop, 3.0)["/sfj/joint_states"]
    # Friction holds the drive where its torque equals the loop's.
    assert states.position[-1, 0] == pytest.approx(0.3, abs=0.6 / 40.0 + 0.005)
    assert states.position[-1, 2] == pytest.approx(-0.2, abs=0.12 / 15.0 + 0.005)


def test_any_function_of_the_readings_can_be_a_controller():
    seen = []

    def controller(time, position, velocity, effort):
        seen.append((time, position.copy(), velocity.copy(), effort.copy()))
        return (0.01, 0.0, -0.01)

    topics = run_closed_loop(OmniRobot(), controller, 0.05)
    states = topics["/omni/joint_states"]
    assert len(seen) == len(states) == 50
    np.testing.assert_allclose([s[0] for s in seen], 1e-3 * np.arange(50), atol=1e-12)
    np.testing.assert_array_equal([s[1] for s in seen], states.position)
    np.testing.assert_array_equal(topics["/omni/effort_command"].effort, np.tile([0.01, 0.0, -0.01], (50, 1)))


def test_the_topics_make_a_recording(tmp_path):
    robot = SfjRobot()
    topics = run_open_loop(robot, currents(100) * robot.torque_constants)
    write_recording(tmp_path / "bag", topics, {}, {"kind": "identification"})
    again = read_recording(tmp_path / "bag").topics
    np.testing.assert_array_equal(again["/sfj/joint_states"].position, topics["/sfj/joint_states"].position)


@pytest.mark.parametrize("shape", [(100,), (100, 3), (0,)])
def test_an_effort_of_another_shape_is_refused(shape):
    with pytest.raises(ConfigurationError, match=r"give \(samples, 2\)"):
        run_open_loop(SfjRobot(), np.zeros(shape))


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan"), float("inf")])
def test_a_duration_that_is_no_time_is_refused(duration):
    with pytest.raises(ConfigurationError, match="duration"):
        run_closed_loop(SfjRobot(), lambda *_: (0.0, 0.0), duration)
