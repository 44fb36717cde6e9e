"""What simulated plants and drivers share as nodes: states out, commands in, and when a command may be used.

A command is used when it is finite, names the robot's joints, and answers a state not older than `timeout`.
The executor only stores commands; a thread of the subclass reads the device or steps the plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from rclpy.context import Context

from haptic_teleop_control.faults import (
    COMMAND_FAULTS,
    CONTRADICTORY_COMMAND,
    FUTURE_COMMAND,
    MALFORMED_COMMAND,
    NON_FINITE_COMMAND,
    STALE_COMMAND,
    UNCOORDINATED_COMMAND,
)
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.streams.joint_states import (
    FIELDS,
    NON_FINITE,
    WRONG_JOINTS,
    JointStatePublisher,
    JointStateReceiver,
)
from haptic_teleop_control.nodes.streams.latency import LatencyMeter
from haptic_teleop_control.simulated_time.messages import Tick
from haptic_teleop_control.simulated_time.stamps import LAST_WORD, seconds
from haptic_teleop_control.warning_list import DEADLINE_SHARE

Array = NDArray[np.float64]

PROBLEMS = {NON_FINITE: NON_FINITE_COMMAND, WRONG_JOINTS: MALFORMED_COMMAND}
"""Kind of a problem -> the fault that it is, where the two names differ."""

SIMULATED = 10**15
"""ns: stamps below are no moment of the last fifty years, but simulated time."""

START_PATIENCE = 200_000_000
"""ns for which late commands are only dropped as long as nothing has been driven yet."""


class CommandedNode(HapticNode):
    """Subclasses state the joints and have the parameter `timeout`; they call `permitted` at every sample."""

    JOINTS: ClassVar[Sequence[str]]
    COMMAND_JOINTS: ClassVar[Sequence[str]]
    FAULTS: ClassVar = COMMAND_FAULTS

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        self._timeout_ns = round(self.values["timeout"] * 1e9)
        self._driven = False  # whether a command has arrived and still holds
        self.dropped = 0
        self._stale_since: int | None = None
        self.latency = LatencyMeter()
        self.states = JointStatePublisher(self, "joint_states", self.JOINTS, FIELDS)
        self._position, self._velocity, self._effort = (self.states.view[field] for field in FIELDS)
        self.commands = JointStateReceiver(
            self, "effort_command", self.COMMAND_JOINTS, ("effort",),
            self.on_command, self._command_problem, self._accept, silence=self.values["timeout"],
            listening=False,  # until the start: another graph's commands are not for this robot
            command=True,
        )  # fmt: skip
        self._command = self.commands.value["effort"]
        self._last_stamp = 0
        self.sampled = 0  # stamp of the state published last, in simulated time
        self._awaiting = False  # whether its answer is still to come
        self._answer = np.zeros(len(self.COMMAND_JOINTS))  # to the state of this stamp; 0: to none
        self._answer_to = 0
        self._awaited = False  # whether that answer was to come from another node
        self.silent = False  # whether there is no state to publish at the next tick
        self.warnings.watch(
            lambda: self.dropped,
            "commands came late or out of order and were dropped",
            lambda: self.dropped + self.commands.count,
            DEADLINE_SHARE,
        )
        self.count_rate("states", lambda: self.states.sent)
        self.count_rate("commands", lambda: self.commands.count)

    def publish_state(self, stamp: int, position: Array, velocity: Array, effort: Array) -> None:
        """Publishes a state sampled at `stamp` (ns)."""
        self._position[:] = position
        self._velocity[:] = velocity
        self._effort[:] = effort
        self.states.send(stamp)

    def permitted(self) -> Array | None:
        """The command in force, (motors,) N·m; None where there is none that may be used now."""
        if not self._driven or self.faults.latched:
            return None
        silence = self.time.now() - self.commands.received
        if silence > self._timeout_ns:
            self._driven = False
            self.fault(STALE_COMMAND, f"{self.commands.topic} is silent for {silence * 1e-9:.3f} s")
            return None
        return self._command

    def on_command(self) -> None:
        """A good command has arrived."""
        if self.time.simulated:
            self._take_answer()
        else:
            self._driven = True

    def _accept(self, stamp: int, received: int) -> bool:
        if self.time.simulated:
            return self._answers_this_state(stamp)
        age = self.time.stamp_at(received) - stamp
        if not -self._timeout_ns <= age <= self._timeout_ns:
            self._refuse(stamp, age * 1e-9)
            return False
        if stamp < self._last_stamp:
            self.dropped += 1
            return False
        self._last_stamp = stamp
        self._stale_since = None
        self.latency.add(age)
        return True

    def _answers_this_state(self, stamp: int) -> bool:
        """In simulated time nothing is late: an answer is that to the state published last, or it is none."""
        # Who says it may not have seen the newest state: time can end between two nodes.
        if stamp - LAST_WORD in (self.sampled, self._answer_to):
            self._driven = False
            return False
        if stamp > self.sampled:
            self._driven = False
            ahead = (stamp - self.sampled) * 1e-9
            self.fault(FUTURE_COMMAND, f"{self.commands.topic}: its stamp is {ahead:.4f} s ahead")
            return False
        known = stamp > 0 and stamp in (self.sampled, self._answer_to)
        self.dropped += not known
        return known

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        if repeated and self.states.sent:
            self.states.resend()
        if self.full_name not in tick.due:
            return
        if tick.stamp == self.sampled:
            if self._awaiting:
                self.time.waiting("answer")
            else:
                self.time.done(silent=self.silent)
            return
        self.sampled = tick.stamp
        self._awaiting = self.states.topic in tick.states
        self.sample(tick.stamp)
        if not self._awaiting:
            self._answer[:], self._answer_to, self._awaited = 0.0, tick.stamp, False
            self._act(None)

    def sample(self, stamp: int) -> None:
        """Simulated time: reads the robot and publishes its state with this stamp."""
        raise NotImplementedError

    def act(self, command: Array | None) -> None:
        """Simulated time: the robot goes on with this command, N·m, or none, to the next sample."""
        raise NotImplementedError

    def _act(self, command: Array | None) -> None:
        self._awaiting = False
        self.act(command)
        self.time.done(silent=self.silent)

    def _take_answer(self) -> None:
        stamp = self.commands.stamp
        if self._awaiting and stamp == self.sampled:
            self._answer[:], self._answer_to, self._awaited = self._command, stamp, True
            self._driven = True
            self._act(self.permitted())
        elif stamp == self._answer_to and not np.array_equal(self._command, self._answer):
            self._driven = False
            name = CONTRADICTORY_COMMAND if self._awaited else UNCOORDINATED_COMMAND
            self.fault(name, f"{self.commands.topic}: at {seconds(stamp):.4f} s")

    def on_time_fault(self, detail: str) -> None:
        self._driven = False
        super().on_time_fault(detail)

    def _refuse(self, stamp: int, age: float) -> None:
        """A command is too old, or of a time to come."""
        now = self.time.now()
        if not self._driven:
            # While a graph comes up its first answers may be late; it is wrong only if that goes on.
            self._stale_since = self._stale_since or now
            if now - self._stale_since < START_PATIENCE:
                self.dropped += 1
                return
        self._driven = False
        what = "without a stamp" if stamp == 0 else f"that answers a state {age:.3f} s old"
        if 0 < stamp < SIMULATED:
            what = (
                f"of simulated time ({seconds(stamp):.3f} s), and this node goes by the wall: set "
                "use_sim_time: true here, or stop one of the two graphs"
            )
        elif age < 0.0:
            what = f"whose stamp is {-age:.3f} s ahead of this node's time"
        self.fault(FUTURE_COMMAND if age < 0.0 else STALE_COMMAND, f"{self.commands.topic}: a command {what}")

    def _command_problem(self, kind: str, detail: str, stamp: int) -> None:
        self._driven = False
        self.fault(PROBLEMS.get(kind, kind), detail)
        if self.time.simulated and self._awaiting and stamp == self.sampled:
            self._answer_to = 0
            self._act(None)  # it is an answer, though none that can be used

    def on_reset(self) -> None:
        self._driven = False
        self._stale_since = None
        self.commands.forget()

    def state(self) -> str:
        if self.faults.latched:
            return "fault"
        return "driven" if self._driven else f"waiting for {self.commands.topic}"
