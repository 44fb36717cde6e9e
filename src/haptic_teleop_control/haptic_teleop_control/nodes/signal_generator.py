"""The signal generator as a node: an artificial command in place of the operator's hand (thesis 2.5)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rclpy.context import Context
from std_srvs.srv import Trigger

from haptic_teleop_control.node_tables import GENERATOR_OWN, SIGNAL_GENERATOR
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.nodes.streams.joint_states import JointStatePublisher
from haptic_teleop_control.nodes.timing.deadline import DeadlineThread
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_control.simulated_time.messages import SOURCE, Tick

PHASE = 0.875
"""At 500 Hz a quarter of a millisecond before the 2DSFJ's state, which is then answered with this reference,
and after the Omni's (`DeadlineThread`)."""

PATTERN, RUNNING = "pattern", "running"
"""Key in the diagnostics that tells what the pattern does, and what it says from start to end."""


class SignalGeneratorNode(HapticNode):
    """Publishes always: zero before the start, after the end and when stopped, so that silence means a
    fault."""

    NAME = "signal_generator"
    SUMMARY = "publishes an artificial command: steps, sweeps, multisine, slow triangle"
    TOPICS = (
        "publishes  reference     position (rad) or effort (N·m) of two joints, the other field empty",
        "publishes  /diagnostics  rate and overruns",
        "service    ~/start       std_srvs/Trigger: begin the signal from its beginning",
        "service    ~/stop        std_srvs/Trigger: back to zero",
    )
    TABLE = SIGNAL_GENERATOR

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        self._started: int | None = None
        self._generator = self._make_generator(self.values)
        kind = self.values["kind"]
        self._out = JointStatePublisher(self, "reference", self.values["joints"], (kind,))
        self._command = self._out.view[kind]
        self.create_service(Trigger, "~/start", self._start)
        self.create_service(Trigger, "~/stop", self._stop)
        self._sample: int | None = None  # simulated time: samples so far since the signal began
        self._sampled = 0
        self._thread = DeadlineThread(
            1.0 / self.values["rate"], self._cycle, self.NAME, self.fail, phase=PHASE, clock=self.wall
        )
        self.watch_periods(self._thread)
        self.count_rate("references", lambda: self._out.sent)

    def start(self) -> None:
        if self.values["autostart"]:
            self._begin()
        if self.time.simulated:
            self.take_part(SOURCE, rate=self.values["rate"], topic=self._out.topic)
        else:
            self._thread.start()

    def _begin(self) -> None:
        self._started, self._sample = self.time.now(), 0

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        if repeated and self._out.sent:
            self._out.resend()
        if self.full_name not in tick.due:
            return
        if tick.stamp != self._sampled:
            self._sampled = tick.stamp
            if self._sample is None or self._started is None:
                self._command.fill(0.0)
            else:
                self._command[:] = self._generator.value(self._sample / self.values["rate"])
                self._sample += 1
            self._out.send(tick.stamp)
        self.time.done()

    def _cycle(self, periods: int) -> None:
        started = self._started
        if started is None:
            self._command.fill(0.0)
        else:
            self._command[:] = self._generator.value((self.time.now() - started) * 1e-9)
        self._out.send(self.time.stamp())

    def _start(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._begin()
        self._announce()  # before the answer: the controller engages by what it knows
        end = self._generator.end
        until = f"ends after {end:g} s" if math.isfinite(end) else "goes on until it is stopped"
        response.success, response.message = True, f"started, {until}"
        return response

    def _stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._started = None
        self._announce()
        response.success, response.message = True, "stopped, the reference is zero"
        return response

    def _make_generator(self, values: Mapping[str, Any]) -> SignalGenerator:
        own = {entry.name for entry in GENERATOR_OWN}
        signal = {name: value for name, value in values.items() if name not in own}
        return SignalGenerator.from_parameters(signal, STAGES, self.NAME)

    def apply_parameters(self, values: Mapping[str, Any]) -> None:
        self._generator = self._make_generator(values)

    def state(self) -> str:
        if self._started is None:
            return "stopped"
        since = (self.time.now() - self._started) * 1e-9
        return RUNNING if since < self._generator.end else "at its end"

    def measurements(self) -> dict[str, Any]:
        skipped = {} if self.time.simulated else {"periods skipped": self._thread.overruns}
        return {PATTERN: self.state(), **skipped}

    def shutdown_safely(self) -> None:
        self._thread.stop()
        if not self.time.simulated and self._out.sent:
            self._out.send_zero(self.time.stamp())
        self.time.close()


NODE = SignalGeneratorNode


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
