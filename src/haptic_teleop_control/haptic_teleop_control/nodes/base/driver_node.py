"""What both drivers share as nodes: a thread that owns the device, paced by the device's own samples.

    read (waits for the device) -> publish the state -> wait for its answer, but not long -> write

The thread is the only one that touches the device. Reading is the loop's clock; a write never waits for a
command, and what has no answer in time is written with the last command until that is too old.

A device that holds the thread is noticed by the executor, which looks for it now and then (`DeviceWatch`).
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from rclpy.context import Context

from haptic_teleop_control.clocks import Clock, VirtualClock
from haptic_teleop_control.device import DeviceError, Driver, ReadResult, Reporter
from haptic_teleop_control.device_watch import (
    DEVICE_FAULTS,
    DEVICE_HANGS,
    LOOK_PERIOD,
    OPENING_TIME,
    DeviceWatch,
)
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.base.commanded import CommandedNode
from haptic_teleop_control.nodes.timing.deadline import request_realtime
from haptic_teleop_control.nodes.timing.time_base import steady_timer
from haptic_teleop_control.raw_capture import COMMAND, RESET, RawCapture, read_capture
from haptic_teleop_control.replay import Session
from haptic_teleop_control.simulated_time.messages import PLANT
from haptic_teleop_control.teleoperation.agreement import VIRTUAL_DEVICES, hardware_refusal
from haptic_teleop_control.warning_list import DEADLINE_SHARE, REALTIME_REFUSED

Array = NDArray[np.float64]

LOST_POLL = 0.1
"""Seconds between two looks for a reset while the device is lost."""

STOP_PATIENCE = 1.0
"""Seconds that the thread has to come back from the device when the node ends."""

FURTHER_STOPS = ("SIGHUP", "SIGQUIT")
"""A terminal that is closed, and Ctrl-\\: by default they end a process without a word to its device."""


def stop_at_further_signals() -> None:
    """Lets the signals of `FURTHER_STOPS` do what SIGTERM does, where the process has a handler for that and
    nobody has arranged anything else for them (nohup). Does nothing outside the main thread."""
    handler = signal.getsignal(signal.SIGTERM)
    if not callable(handler) or threading.current_thread() is not threading.main_thread():
        return
    for number in (getattr(signal, name) for name in FURTHER_STOPS if hasattr(signal, name)):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, handler)


class DriverNode(CommandedNode):
    """Subclasses build their driver in `make_driver`. Parameters that every driver has: `device`,
    `answer_wait`, `timeout`, `device_timeout`, `capture`, `realtime_priority`."""

    ROBOT: ClassVar[str]
    FAULTS: ClassVar = {**CommandedNode.FAULTS, **DEVICE_FAULTS}

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        self._answer_wait = self.values["answer_wait"]
        self._answered = threading.Event()
        self._state_stamp = 0
        self._stop = threading.Event()
        self._wants_reset = threading.Event()
        self._lost = self._over = False
        self.cycles = 0
        self.unanswered = 0
        self.capture: RawCapture | None = None
        self.session: Session | None = None
        if self.values["device"] == "replay":
            if not self.values["replay.file"]:
                raise ConfigurationError(
                    f"{self.NAME}: device is replay, but replay.file is empty; name a file that a driver's "
                    "parameter capture has made."
                )
            self.session = Session(read_capture(self.values["replay.file"], self.ROBOT))
        device = self.values["device"]
        if self.time.simulated and device not in VIRTUAL_DEVICES:
            raise ConfigurationError(hardware_refusal(self.NAME, device))
        self.clock: Clock = VirtualClock() if self.time.simulated else self.wall
        self.driver: Driver = self.make_driver(Reporter(self.fault, lambda: self.faults.latched))
        self.watch = DeviceWatch(self.wall, self.values["device_timeout"])
        self._hangs = ""
        if self.session is None and not self.time.simulated:  # whose pauses are not the device's
            steady_timer(self, LOOK_PERIOD, self._look)
        self.warnings.watch(
            lambda: self.unanswered, "states had no answer in time", lambda: self.cycles, DEADLINE_SHARE
        )
        self.warnings.watch(
            lambda: self.capture.dropped if self.capture else 0, "packets are missing in the capture"
        )
        self._thread = threading.Thread(target=self._run, name=self.NAME, daemon=True)

    def make_driver(self, reporter: Reporter) -> Driver:
        """The driver that the parameters describe, not yet open. Raises HapticTeleopError."""
        raise NotImplementedError

    def start(self) -> None:
        stop_at_further_signals()
        self.commands.listen()
        self._open_capture()
        try:
            self.driver.open()
        except DeviceError as refusal:
            raise ConfigurationError(
                f"{self.get_fully_qualified_name()}: the device cannot be opened: {refusal}; check cable and "
                "power and run `haptic-teleop doctor`, or set device: emulated."
            ) from refusal
        self.get_logger().info(self.driver.describe())
        if self.time.simulated:
            self._read_ahead()
            rate, states, commands = self.values["rate"], self.states.topic, self.commands.topic
            self.take_part(PLANT, rate=rate, topic=states, commands=commands, silent=self.silent)
        else:
            self._thread.start()

    def _open_capture(self) -> None:
        path = self.values["capture"]
        if path:
            parameters: Mapping[str, Any] = dict(self.values)
            self.capture = RawCapture(Path(path), self.ROBOT, parameters)
            self.get_logger().info(f"raw packets go to {path}")

    def on_command(self) -> None:
        super().on_command()
        if self.commands.stamp >= self._state_stamp:
            self._answered.set()

    def on_reset(self) -> None:
        super().on_reset()
        self._wants_reset.set()

    def _look(self) -> None:
        away = self.watch.look()
        if away is None:
            self._hangs = ""
            return
        known, self._hangs = self._hangs, f"{away[0]} has not come back for {away[1]:.1f} s"
        self._driven = False
        if not known or self.faults.latched is None:  # a reset does not bring the device back
            self.fault(DEVICE_HANGS, self._hangs)

    # Simulated time: the executor owns the device, whose clock stands still between two ticks. What the next
    # tick publishes is read before it, because time has to know whether there is something.

    def sample(self, stamp: int) -> None:
        self._state_stamp = stamp
        if not self.silent:
            self.publish_state(stamp, self.driver.position, self.driver.velocity, self.driver.effort)

    def act(self, command: Array | None) -> None:
        if self.session is not None:
            _, command = self.session.next_command()
        self._write(command)
        self._read_ahead()

    def _read_ahead(self) -> None:
        if self._wants_reset.is_set():
            self._reset_device(self._lost)
        result = self._read()
        self.silent = result is not ReadResult.STATE

    # Real time: the thread that owns the device.

    def _run(self) -> None:
        if self.values["realtime_priority"]:
            thread = [threading.get_native_id()]
            if not request_realtime(self.values["realtime_priority"], thread):
                self.warnings.state("real time", REALTIME_REFUSED)
        try:
            while not self._stop.is_set():
                if self._wants_reset.is_set():
                    self._reset_device(self._lost)
                if not self._cycle():
                    break
        except Exception as failure:
            self.fail(failure)
        finally:
            self.driver.close()

    def _reset_device(self, reopened: bool) -> None:
        self._wants_reset.clear()
        if self.capture is not None:
            self.capture.add(RESET, self.time.stamp(), bytes([reopened]))
        self.watch.enter("reset", OPENING_TIME)
        if reopened:
            self.driver.close()
        self.driver.reset()
        self.watch.leave()

    def _read(self) -> ReadResult:
        if self._over:
            return ReadResult.END
        reopened = None if self.session is None else self.session.take_reset()
        if reopened is not None:
            self.faults.reset()
            self.announce()
            self._reset_device(reopened)
        self.watch.enter("read")
        result = self.driver.read()
        self.watch.leave()
        self._lost = result is ReadResult.LOST
        if self._lost:
            self._driven = False
        elif result is ReadResult.END:
            self._over = True
            self.get_logger().info("the replayed session is over")
        else:
            self.cycles += 1
        return result

    def _cycle(self) -> bool:
        result = self._read()
        if result is ReadResult.END:
            return False
        if result is ReadResult.LOST:
            self._wants_reset.wait(LOST_POLL)  # nothing paces the loop now
            return True
        if result is ReadResult.STATE:
            self._answered.clear()
            self._state_stamp = self.time.stamp()
            self.publish_state(
                self._state_stamp, self.driver.position, self.driver.velocity, self.driver.effort
            )
        self._give(result is ReadResult.STATE)
        return True

    def _give(self, answerable: bool) -> None:
        if self.session is not None:
            _, command = self.session.next_command()
        else:
            if answerable and self._driven and not self._answered.wait(self._answer_wait):
                self.unanswered += 1
            command = self.permitted() if answerable else None
            if command is not None:
                command = command.copy()  # at once: the executor may store the next one at any moment
        self._write(command)

    def _write(self, command: Array | None) -> None:
        if self.capture is not None:
            data = b"" if command is None else np.asarray(command, dtype="<f8").tobytes()
            self.capture.add(COMMAND, self._state_stamp, data)
        self.watch.enter("write")
        self.driver.write(command)
        self.watch.leave()

    # What is said about it.

    def state(self) -> str:
        if self._hangs:
            return f"device hangs: {self._hangs}"
        return "device lost" if self._lost else super().state()

    def measurements(self) -> dict[str, Any]:
        values = {
            "device": self.values["device"],
            # What the driver knew before its device held it is not so any more.
            **({"device call": self._hangs} if self._hangs else self.driver.measurements()),
            "states without an answer in time": self.unanswered,
            "commands out of order": self.dropped,
            **self.latency.summary(),
        }
        if self.capture is not None:
            values["packets not captured"] = self.capture.dropped
            if self.capture.failure is not None:
                values["capture failed"] = str(self.capture.failure)
                self.warnings.state("capture", f"the capture failed: {self.capture.failure}")
        return values

    def shutdown_safely(self) -> None:
        self._driven = False
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join(STOP_PATIENCE)
        self.time.close()
        self.driver.close()  # again, in case the thread never ran or hangs in the device
        if self.capture is not None:
            self.capture.close()
            if self.capture.dropped or self.capture.failure is not None:
                reason = self.capture.failure or "the disk did not keep up"
                self.get_logger().warning(
                    f"the capture is not complete, {self.capture.dropped} packets are missing: {reason}"
                )
