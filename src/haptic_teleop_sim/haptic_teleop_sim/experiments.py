"""Experiments on one simulated robot without ROS or clock: a given effort, or a controller of one's own.

    robot = SfjRobot()
    topics = run_open_loop(robot, current * robot.torque_constants)            # (n, 2) N·m
    topics = run_closed_loop(robot, PositionLoop(robot, target), duration=10)  # target(t) -> (2,) rad

The series are what a recording of the robot's node would hold, so `write_recording` makes a bag of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import JointStateSeries

from .kernel import stepping
from .robot import Robot
from .stamps import sample_times, series
from .step_result import StepResult

Array = NDArray[np.float64]

Controller = Callable[[float, Array, Array, Array], ArrayLike]
"""(time s, position rad, velocity rad/s, effort N·m) of all joints -> effort of the motors, N·m."""


class SteppedRobot(Protocol):
    """What a closed loop needs of a robot: `SfjRobot`, `OmniRobot`, `MujocoRobot`, or one of your own."""

    @property
    def namespace(self) -> str: ...

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def motors(self) -> Sequence[str]: ...

    @property
    def dt(self) -> float: ...

    @property
    def time(self) -> float: ...

    def sense(self) -> tuple[Array, Array, Array]: ...

    def step(self, effort_command: ArrayLike) -> StepResult: ...


def run_open_loop(
    robot: Robot, effort: ArrayLike, external_torque: ArrayLike | None = None
) -> dict[str, JointStateSeries]:
    """The robot's topics while `effort` (n, motors), N·m, is commanded sample by sample.

    `external_torque` (n, motors), N·m, acts at the arms. The robot goes on from where it is; stamps begin at
    its time zero. Raises ConfigurationError for arrays of another shape.
    """
    commands = np.ascontiguousarray(effort, dtype=np.float64)
    if commands.ndim != 2 or commands.shape[1] != len(robot.motors):
        raise ConfigurationError(
            f"open loop: effort has the shape {commands.shape}; give (samples, {len(robot.motors)})."
        )
    outer = np.zeros_like(commands)
    if external_torque is not None:
        outer[:] = external_torque
    n = len(commands)
    out = np.empty((n, 3, len(robot.names)))
    start = robot.time
    counts = np.zeros(len(StepResult), dtype=np.int64)
    stepping().open_loop(commands, outer, robot.bank, robot.device, robot.take_noise(n), out, counts)
    return _topics(robot, start + sample_times(1.0 / robot.dt, n * robot.dt), out, commands)


def run_closed_loop(
    robot: SteppedRobot,
    controller: Controller,
    duration: float,
    over: Callable[[float], bool] = lambda time: False,
) -> dict[str, JointStateSeries]:
    """The robot's topics while `controller` answers every sample, for `duration` s from where the robot is.

    The answer to a sample acts until the next. over: told the time of each sample after it was answered,
    whether it was the last. Raises ConfigurationError for a duration that is not positive.
    """
    times = robot.time + sample_times(1.0 / robot.dt, duration)
    out = np.empty((len(times), 3, len(robot.names)))
    commands = np.empty((len(times), len(robot.motors)))
    for k, now in enumerate(times.tolist()):
        for row, signal in enumerate(robot.sense()):
            out[k, row] = signal
        commands[k] = controller(now, out[k, 0], out[k, 1], out[k, 2])
        robot.step(commands[k])
        if over(now):
            return _topics(robot, times[: k + 1], out[: k + 1], commands[: k + 1])
    return _topics(robot, times, out, commands)


class PositionLoop:
    """A controller that moves the motors along a target: effort = kp (target - position) - kd velocity.

    robot: gives limits and indices of the motors. target: time, s -> (motors,) rad. kp: N·m/rad, kd:
    N·m·s/rad, for each motor or all.
    """

    def __init__(
        self, robot: Robot, target: Callable[[float], ArrayLike], kp: ArrayLike = 20.0, kd: ArrayLike = 0.5
    ) -> None:
        self._motors = [robot.names.index(name) for name in robot.motors]
        self._target, self._kp, self._kd = target, np.asarray(kp), np.asarray(kd)

    def __call__(self, time: float, position: Array, velocity: Array, effort: Array) -> Array:
        error = np.asarray(self._target(time)) - position[self._motors]
        return self._kp * error - self._kd * velocity[self._motors]


def _topics(robot: SteppedRobot, times: Array, states: Array, commands: Array) -> dict[str, JointStateSeries]:
    return {
        f"{robot.namespace}/joint_states": series(times, robot.names, states=states),
        f"{robot.namespace}/effort_command": series(times, robot.motors, effort=commands),
    }
