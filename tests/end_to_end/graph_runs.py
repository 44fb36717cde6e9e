"""Runs of a scenario as processes that are stopped now and then, and what their recordings hold."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.simulated_time.messages import PAUSED, STATUS_TOPIC, Status, decode
from haptic_teleop_control.simulated_time.stamps import seconds

FIELDS = ("position", "velocity", "effort")
CONFIG = Path(__file__).parents[2] / "config"
FRONT_DOOR = (sys.executable, "-m", "haptic_teleop_control.front_door")


def scenario_command(file: str | Path, bag: Path, *options: str) -> list[str]:
    """The command line of a recorded scenario."""
    return [*FRONT_DOOR, "scenario", str(file), "--record", str(bag), *options]


def children_of(pid: int) -> list[int]:
    """Process numbers of all descendants, and of `pid` itself."""
    found = [pid]
    try:
        for task in Path(f"/proc/{pid}/task").iterdir():
            for child in (task / "children").read_text().split():
                found += children_of(int(child))
    except OSError:
        pass
    return found


def send(pids: list[int], number: signal.Signals) -> None:
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def stop_now_and_then(
    run: subprocess.Popen, luck: random.Random, freeze: float, begin: float, span: float = 6.0
) -> int:
    """Stops processes until the run is over; how often. freeze: s for which all are stopped, three times
    within `span` s; 0: single ones for 0.07 to 1.5 s. begin: s before the first stop."""
    stops = 0
    time.sleep(begin)
    moments = sorted(luck.uniform(0.0, span) for _ in range(3)) if freeze else []
    began = time.monotonic()
    while run.poll() is None:
        if freeze:
            if not moments:
                time.sleep(0.1)
                continue
            time.sleep(max(0.0, moments.pop(0) - (time.monotonic() - began)))
            pids, seconds = children_of(run.pid), freeze
        else:
            time.sleep(luck.uniform(0.05, 0.6))
            pids, seconds = [luck.choice(children_of(run.pid))], luck.uniform(0.07, 1.5)
        send(pids, signal.SIGSTOP)
        time.sleep(seconds)
        send(pids, signal.SIGCONT)
        stops += 1
    return stops


def differences(bag: Path, expected: dict) -> list[str]:
    """What of the recording is not as lockstep says, in words."""
    recording, found = read_recording(bag), []
    topics, recorded = recording.topics, recording.parameters["/recorder"]["topics"]
    for name, wanted in expected.items():
        if name not in topics:
            if name in recorded:
                found.append(f"{name} is missing")
            continue
        seen = topics[name]
        if not np.array_equal(seen.stamp, wanted.stamp):
            found.append(f"{name}: {len(seen)} samples for {len(wanted)}, or other stamps")
            continue
        for field in FIELDS:
            one, other = getattr(seen, field), getattr(wanted, field)
            if other is not None and other.size and one.tobytes() != other.tobytes():
                found.append(f"{name}: {field} differs by {np.max(np.abs(one - other)):.3g}")
    return found


class Supervisor:
    """Looks at a running scenario in simulated time and calls its services; a context manager.

    time, time_state: s, and whether it runs, as its coordinator said last. states: node -> what it does, by
    its diagnostics.
    """

    def __enter__(self) -> Self:
        self.time, self.time_state, self.states = 0.0, "", {}
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node("supervisor", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._node.create_subscription(String, STATUS_TOPIC, self._take_status, 10)
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._take_state, 50)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def until(self, condition: Callable[[], object], deadline: float = 120.0) -> None:
        end = time.monotonic() + deadline
        while not condition():
            assert time.monotonic() < end, f"not in {deadline} s; at {self.time} s, {self.states}"
            self._executor.spin_once(timeout_sec=0.05)

    def call(self, service: str) -> str:
        """Calls it, which succeeds; what it says."""
        client = self._node.create_client(Trigger, service)
        self.until(client.service_is_ready)
        answer = client.call_async(Trigger.Request())
        self.until(answer.done)
        assert answer.result().success, answer.result().message
        return answer.result().message

    def pause(self) -> float:
        """Pauses simulated time; s, where it stands. What was said before may not be read yet."""
        self.call("/time_coordinator/pause")
        self.until(lambda: self.time_state == PAUSED)
        return self.time

    def _take_status(self, message: String) -> None:
        status = decode(message.data)
        if isinstance(status, Status):
            self.time, self.time_state = seconds(status.stamp), status.state

    def _take_state(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            self.states[status.name] = values.get("state", "")
