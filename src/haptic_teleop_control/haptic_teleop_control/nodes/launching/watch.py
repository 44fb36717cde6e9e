"""Looking at a running scenario from outside: where the stages are, which faults there were, one live line
of it.

The watcher takes a sample now and then; it never reads a topic at its full rate.
"""

from __future__ import annotations

import math
import sys
import time
from types import TracebackType
from typing import Self

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rich.console import Console
from rich.live import Live
from rich.text import Text
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from haptic_teleop_control.nodes.launching.run_node import RunNode
from haptic_teleop_control.nodes.streams.senders import Info, process_of, with_info
from haptic_teleop_control.robots import OMNI_JOINTS, SFJ_JOINTS, STAGES
from haptic_teleop_control.simulated_time.messages import HALTED, OVER, PAUSED, STATUS_TOPIC, Status, decode
from haptic_teleop_control.simulated_time.participant import COORDINATOR_LIVENESS
from haptic_teleop_control.simulated_time.stamps import seconds

NEWEST_ONLY = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LONGEST_LOOK = 0.3
"""s counted at most between two looks: what is longer, we stood still ourselves."""
PLAIN_INTERVAL = 2.0
"""Seconds between two lines where standard error is no terminal."""


class Watcher:
    """An rclpy node that knows the latest state of a robot ("sfj" or "omni") and every fault reported; a
    context manager.

    run: the id of the run that it watches, if it is one of `scenario`; run_node: that run as others see it.
    faults: node -> the sentence it reported last, also after a reset. warnings: node -> how many warnings it
    reported that were no faults, and the last one. node: the node, within the context.
    processes: ids of the run's own, if known: in simulated time no other diagnostics are the run's.
    Time counts from `begin`, or is the simulated one. time: what its coordinator said last, that of `run`.
    """

    def __init__(self, robot: str = "sfj", simulated: bool = False, run: str = "") -> None:
        self._run = run
        self.processes: frozenset[str] = frozenset()
        self._namespace = f"/{robot}/"
        self._topic = f"/{robot}/joint_states"
        self._joints = SFJ_JOINTS if robot == "sfj" else OMNI_JOINTS
        self.faults: dict[str, str] = {}
        self.warnings: dict[str, tuple[int, str]] = {}
        self._in_fault: dict[str, None] = {}
        self._begun: float | None = None
        self.simulated = simulated
        self.time: Status | None = None
        self._looked = self._untold = 0.0
        self._first_fault: float | None = None
        self._state: JointState | None = None

    def __enter__(self) -> Self:
        rclpy.init(args=[], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        self.node = Node("scenario", start_parameter_services=False)
        self.run_node = RunNode(self._run) if self._run else None
        self.node.create_subscription(JointState, self._topic, self._take, NEWEST_ONLY)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", with_info(self._diagnose), 10)
        if self.simulated:
            self.node.create_subscription(String, STATUS_TOPIC, self._take_status, 10)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown()
        if self.run_node is not None:
            self.run_node.destroy_node()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def begin(self) -> None:
        """The nodes start now."""
        self._begun = self._looked = time.monotonic()
        self._untold = 0.0

    @property
    def elapsed(self) -> float:
        """Seconds of the experiment: simulated ones, or those since `begin`; 0 before it."""
        if self.simulated:
            return 0.0 if self.time is None else seconds(self.time.stamp)
        return self.waited

    @property
    def waited(self) -> float:
        """Seconds of the wall since `begin`; 0 before it."""
        return 0.0 if self._begun is None else time.monotonic() - self._begun

    @property
    def pace(self) -> str:
        """How fast simulated time has gone, in words."""
        achieved = 0.0 if self.time is None else self.time.achieved
        return f"{self.elapsed:.1f} s of simulated time, real-time factor {achieved:.2f}"

    def over(self, duration: float) -> bool:
        """Whether the experiment has come to its end, and everything is recorded."""
        if self.simulated:
            return self.time is not None and self.time.state in (OVER, HALTED)
        return duration > 0.0 and self.elapsed >= duration

    def lost(self) -> str:
        """What is wrong when nobody grants simulated time any more, in words; else empty. A law that does not
        return holds its process, and with it a coordinator that lives there."""
        if not self.simulated or self._begun is None or self._untold <= COORDINATOR_LIVENESS:
            return ""
        return (
            f"the coordinator of simulated time has been silent for {COORDINATOR_LIVENESS:g} s: its process "
            "stands still; look for a node in it that does not return (--processes gives each one its own)"
        )

    @property
    def in_fault_for(self) -> float:
        """Seconds of the experiment since the first fault was looked at; 0 before."""
        if self._first_fault is None and self.faults:
            self._first_fault = self.elapsed
        return 0.0 if self._first_fault is None else self.elapsed - self._first_fault

    @property
    def blind(self) -> bool:
        """Whether no state has been seen yet, nor a plant that takes part in simulated time: a short
        experiment may be over before anybody has looked."""
        there = () if self.time is None else self.time.members
        return self._state is None and not any(name.startswith(self._namespace) for name in there)

    @property
    def paused(self) -> bool:
        """Whether somebody has stopped simulated time for a while."""
        return self.time is not None and self.time.state == PAUSED

    def look(self, seconds: float) -> None:
        """Waits, then takes what is there."""
        time.sleep(seconds)
        now = time.monotonic()
        self._untold += min(now - self._looked, LONGEST_LOOK)
        self._looked = now
        for _ in range(8):  # newest state, diagnostics of a few nodes, and rclpy's own
            self._executor.spin_once(timeout_sec=0.0)

    def line(self, duration: float) -> str:
        """Time, and angle of the arm and torque on the environment of both stages."""
        total = f" / {duration:.0f}" if duration > 0.0 else ""
        parts = [f"{self.elapsed:5.1f}{total} s"]
        if self._state is None:
            waiting = "paused" if self.paused else (self.time.reason if self.time is not None else "")
            return f"{parts[0]}   {waiting or f'waiting for {self._topic}'}"
        if self._joints == OMNI_JOINTS:
            values = zip(OMNI_JOINTS, self._state.position, self._state.effort, strict=True)
            for name, angle, torque in values:
                parts.append(f"{name}: {angle:+.3f} rad {torque:+.3f} N·m")
        for index, stage in enumerate(STAGES if self._joints == SFJ_JOINTS else ()):
            arm = SFJ_JOINTS.index(f"{stage}_arm")
            angle, torque = self._state.position[arm], self._state.effort[arm]
            parts.append(f"stage {index + 1}: {angle:+.3f} rad {torque:+.3f} N·m")
        if self.paused:
            parts.append("paused")
        if self._in_fault:
            parts.append(f"FAULT in {', '.join(self._in_fault)}")
        return "   ".join(parts)

    def _take(self, message: JointState) -> None:
        if list(message.name) == list(self._joints) and len(message.effort) == len(self._joints):
            self._state = message

    def _take_status(self, message: String) -> None:
        status = decode(message.data)
        if isinstance(status, Status) and status.run == self._run:
            self.time, self._untold = status, 0.0
            if status.state == OVER and status.reason:
                self.faults["/time_coordinator"] = f"simulated time ended early: {status.reason}"
            if status.state == HALTED:
                self.faults["/time_coordinator"] = f"simulated time is halted: {status.reason}"

    def _diagnose(self, message: DiagnosticArray, info: Info) -> None:
        process = process_of(info)
        if self.simulated and process and self.processes and process not in self.processes:
            return
        for status in message.status:
            if status.level == DiagnosticStatus.ERROR:
                self.faults[status.name] = status.message
                self._in_fault[status.name] = None
            else:
                self._in_fault.pop(status.name, None)
            if status.level == DiagnosticStatus.WARN:
                count = self.warnings.get(status.name, (0, ""))[0]
                self.warnings[status.name] = (count + 1, status.message)


class ProgressLine:
    """One line on standard error: rewritten in place on a terminal, otherwise printed every two seconds, and
    none twice; the last one always stays."""

    def __init__(self) -> None:
        self._text = ""
        self._printed: set[str] = set()
        self._console = Console(stderr=True)
        self._live = Live(console=self._console, auto_refresh=False) if self._console.is_terminal else None
        self._last = -math.inf

    def __enter__(self) -> Self:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()
        elif self._text:
            print(self._text, file=sys.stderr, flush=True)

    def show(self, text: str) -> None:
        self._text = text
        if self._live is not None:
            self._live.update(Text(text, no_wrap=True), refresh=True)
        elif text in self._printed:
            self._text = ""
        elif time.monotonic() - self._last > PLAIN_INTERVAL:
            self._last = time.monotonic()
            self._text = ""
            self._printed.add(text)
            print(text, file=sys.stderr, flush=True)
