"""What both simulated plants share as nodes: a robot stepped in real time, commands checked, states
published.

The robot is stepped by a thread of its own at absolute deadlines with the latest command; the executor only
stores commands. A command is used when it is finite, names the robot's joints, and answers a state not
older than `timeout`.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray
from rclpy.context import Context

from haptic_teleop_control.faults import COMMAND_FAULTS, MALFORMED_COMMAND, NON_FINITE_COMMAND, STALE_COMMAND
from haptic_teleop_control.nodes.base import HapticNode
from haptic_teleop_control.nodes.deadline import DeadlineThread
from haptic_teleop_control.nodes.joint_state_io import (
    FIELDS,
    JointStatePublisher,
    JointStateReceiver,
    stamp_at,
    stamp_now,
)
from haptic_teleop_control.nodes.latency import LatencyMeter

Array = NDArray[np.float64]

LONGEST_CATCH_UP = 1.0
"""Seconds of simulation made up for at once after a stall; what is longer than that is lost, and counted."""

START_PATIENCE = 0.2
"""Seconds for which late commands are only dropped as long as nothing has been driven yet."""


class Robot(Protocol):
    """What the node needs of a simulated robot; positions rad, velocities rad/s, efforts N·m."""

    def sense(self) -> tuple[Array, Array, Array]: ...

    def step(self, effort_command: Array) -> None: ...


class PlantNode(HapticNode):
    """Subclasses state the joints and build the robot in `make_robot`."""

    JOINTS: ClassVar[Sequence[str]]
    COMMAND_JOINTS: ClassVar[Sequence[str]]
    FAULTS: ClassVar = {
        name: COMMAND_FAULTS[name] for name in (NON_FINITE_COMMAND, MALFORMED_COMMAND, STALE_COMMAND)
    }

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        rate = self.values["rate"]
        self._timeout_ns = round(self.values["timeout"] * 1e9)
        self._most_steps = max(1, int(LONGEST_CATCH_UP * rate))
        self.robot: Robot = self.make_robot(1.0 / rate)
        self._zero = np.zeros(len(self.COMMAND_JOINTS))
        self._sensed = False
        self._driven = False  # whether a command has arrived and still holds
        self.dropped = 0
        self.lost_steps = 0
        self._stale_since: float | None = None
        self.latency = LatencyMeter()
        self.states = JointStatePublisher(self, "joint_states", self.JOINTS, FIELDS)
        self._position, self._velocity, self._effort = (self.states.view[field] for field in FIELDS)
        self.commands = JointStateReceiver(
            self, "effort_command", self.COMMAND_JOINTS, ("effort",),
            self._on_command, self._command_problem, self._accept,
        )  # fmt: skip
        self._command = self.commands.value["effort"]
        self._last_stamp = 0
        self.thread = DeadlineThread(1.0 / rate, self._cycle, self.NAME, self.fail)
        self.count_rate("states", lambda: self.states.sent)
        self.count_rate("commands", lambda: self.commands.count)
        self.robot.step(self._zero)  # compiles now, not in the loop
        self.robot = self.make_robot(1.0 / rate)

    def start(self) -> None:
        self.thread.start()

    def make_robot(self, dt: float) -> Robot:
        """The robot that the parameters describe, stepped every dt seconds. Raises HapticTeleopError."""
        raise NotImplementedError

    def _cycle(self, periods: int) -> None:
        # The answer to the last state holds until this one, as a board holds its output until the next.
        if self._sensed:
            command = self._permitted()
            steps = min(periods, self._most_steps)
            self.lost_steps += periods - steps
            for _ in range(steps - 1):  # after a stall: the time that went by without us
                self.robot.step(command)
                self.robot.sense()
            self.robot.step(command)
        self._sensed = True
        position, velocity, effort = self.robot.sense()
        stamp = stamp_now()
        self._position[:] = position
        self._velocity[:] = velocity
        self._effort[:] = effort
        self.states.send(stamp)

    def _permitted(self) -> Array:
        if not self._driven or self.faults.latched:
            return self._zero
        silence = time.monotonic_ns() - self.commands.received
        if silence > self._timeout_ns:
            self._driven = False
            self.fault(STALE_COMMAND, f"{self.commands.topic} is silent for {silence * 1e-9:.3f} s")
            return self._zero
        return self._command

    def _accept(self, stamp: int, received: int) -> bool:
        age = stamp_at(received) - stamp
        if not -self._timeout_ns <= age <= self._timeout_ns:
            self._refuse_stale(stamp, age * 1e-9)
            return False
        if stamp < self._last_stamp:
            self.dropped += 1
            return False
        self._last_stamp = stamp
        self._stale_since = None
        self.latency.add(age)
        return True

    def _refuse_stale(self, stamp: int, age: float) -> None:
        now = time.monotonic()
        if not self._driven:
            # While a graph comes up its first answers may be late; it is wrong only if that goes on.
            self._stale_since = self._stale_since or now
            if now - self._stale_since < START_PATIENCE:
                self.dropped += 1
                return
        self._driven = False
        what = "without a stamp" if stamp == 0 else f"that answers a state {age:.3f} s old"
        self.fault(STALE_COMMAND, f"{self.commands.topic}: a command {what}")

    def _on_command(self) -> None:
        self._driven = True

    def _command_problem(self, kind: str, detail: str, stamp: int) -> None:
        self._driven = False
        self.fault(NON_FINITE_COMMAND if kind == "non_finite" else MALFORMED_COMMAND, detail)

    def on_reset(self) -> None:
        self._driven = False
        self._stale_since = None
        self.commands.forget()

    def state(self) -> str:
        if self.faults.latched:
            return "fault"
        return "driven" if self._driven else f"waiting for {self.commands.topic}"

    def measurements(self) -> dict[str, Any]:
        return {
            "periods skipped": self.thread.overruns,
            "steps lost": self.lost_steps,
            "commands out of order": self.dropped,
            **self.latency.summary(),
        }

    def shutdown_safely(self) -> None:
        self._driven = False
        self.thread.stop()
