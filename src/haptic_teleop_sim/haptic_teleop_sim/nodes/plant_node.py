"""What both simulated plants share as nodes: a robot stepped in real time, commands checked, states
published.

In real time the robot is stepped by a thread of its own at absolute deadlines with the latest command; in
simulated time at every tick, by the command that answers its state.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from rclpy.context import Context

from haptic_teleop_control.nodes.base.commanded import CommandedNode
from haptic_teleop_control.nodes.timing.deadline import DeadlineThread
from haptic_teleop_control.simulated_time.messages import PLANT

Array = NDArray[np.float64]

LONGEST_CATCH_UP = 1.0
"""Seconds of simulation made up for at once after a stall; what is longer than that is lost, and counted."""


class Robot(Protocol):
    """What the node needs of a simulated robot; positions rad, velocities rad/s, efforts N·m.

    powered: whether a command is in force.
    """

    powered: bool

    def sense(self) -> tuple[Array, Array, Array]: ...

    def step(self, effort_command: Array) -> None: ...


class PlantNode(CommandedNode):
    """Subclasses state the joints, their phase (`DeadlineThread`) and build the robot in `make_robot`."""

    PHASE: ClassVar[float] = 0.0

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        rate = self.values["rate"]
        self._most_steps = max(1, int(LONGEST_CATCH_UP * rate))
        self.robot: Robot = self.make_robot(1.0 / rate)
        self._zero = np.zeros(len(self.COMMAND_JOINTS))
        self._sensed = False
        self.lost_steps = 0
        self.thread = DeadlineThread(
            1.0 / rate, self._cycle, self.NAME, self.fail, phase=self.PHASE, clock=self.wall
        )
        self.watch_periods(self.thread)
        self.robot.step(self._zero)  # compiles now, not in the loop
        self.robot = self.make_robot(1.0 / rate)

    def start(self) -> None:
        self.commands.listen()
        if self.time.simulated:
            rate, states, commands = self.values["rate"], self.states.topic, self.commands.topic
            self.take_part(PLANT, rate=rate, topic=states, commands=commands)
        else:
            self.thread.start()

    def sample(self, stamp: int) -> None:
        self.publish_state(stamp, *self.robot.sense())

    def act(self, command: Array | None) -> None:
        self.robot.powered = command is not None
        self.robot.step(self._zero if command is None else command)

    def make_robot(self, dt: float) -> Robot:
        """The robot that the parameters describe, stepped every dt seconds. Raises HapticTeleopError."""
        raise NotImplementedError

    def _cycle(self, periods: int) -> None:
        # The answer to the last state holds until this one, as a board holds its output until the next.
        if self._sensed:
            command = self.permitted()
            self.robot.powered = command is not None
            command = self._zero if command is None else command
            steps = min(periods, self._most_steps)
            self.lost_steps += periods - steps
            for _ in range(steps - 1):  # after a stall: the time that went by without us
                self.robot.step(command)
                self.robot.sense()
            self.robot.step(command)
        self._sensed = True
        signals = self.robot.sense()
        self.publish_state(self.time.stamp(), *signals)

    def measurements(self) -> dict[str, Any]:
        if self.time.simulated:
            return {"commands out of order": self.dropped}
        return {
            "periods skipped": self.thread.overruns,
            "steps lost": self.lost_steps,
            "commands out of order": self.dropped,
            **self.latency.summary(),
        }

    def shutdown_safely(self) -> None:
        self._driven = False
        self.thread.stop()
        self.time.close()
