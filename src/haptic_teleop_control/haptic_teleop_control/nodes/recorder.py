"""Records topics to an MCAP bag that describes itself: in its own process, serialised, verified after
stopping."""

from __future__ import annotations

import gc
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.forced_exit import ends_within
from haptic_teleop_control.named_files import model_texts
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.node_help import node_help
from haptic_teleop_control.nodes.base.run import LEAVING, create_nodes, make_executor, read_arguments
from haptic_teleop_control.nodes.launching.arming import ArmedStart
from haptic_teleop_control.nodes.launching.connections import IN, OUT, Endpoints, endpoints, processes_of
from haptic_teleop_control.nodes.launching.stopping import stop_requests
from haptic_teleop_control.nodes.recording.parameter_collector import ParameterCollector
from haptic_teleop_control.nodes.recording.recorded_topic import RecordedTopic
from haptic_teleop_control.nodes.recording.repetitions import Repetitions
from haptic_teleop_control.nodes.recording.verdict import print_verdict
from haptic_teleop_control.nodes.timing.time_base import SimulatedTime, steady_timer
from haptic_teleop_control.recorder_parameters import (
    JOINT_STATE,
    KNOWN_TYPES,
    TABLE,
    experiment_description,
)
from haptic_teleop_control.recording.free_space import FreeSpace
from haptic_teleop_control.recording.joint_state_cdr import header_stamp
from haptic_teleop_control.recording.verify import verify_recording
from haptic_teleop_control.recording.writer import RecordingWriter
from haptic_teleop_control.simulated_time.messages import RECORDER, Status
from haptic_teleop_control.simulated_time.stamps import ORIGIN, seconds

FOLLOW_PERIOD = 0.1
DRAIN_PERIOD = 0.005
"""Seconds between two looks for messages; the time of reception is the middleware's, not that of the look."""
LOG_PERIOD = 10.0
LAST_LOOKS, NOTHING_FOR = 100, 10
"""Looks for messages that were sent before the end, at most, and without any after which none is awaited;
counted, so that a machine that stands still meanwhile misses none that has arrived."""
ACKNOWLEDGED = 20_000_000
"""ns of simulated time after which the coordinator is told again what is kept."""


class Recorder(HapticNode):
    """Writes every message it receives until `stop` is set; `finish` ends the recording.

    With `armed` it takes messages and drops them until that start is there, so that the recording begins
    with the experiment.
    """

    NAME = "recorder"
    SUMMARY = "records topics to an MCAP bag that describes itself"
    TOPICS = ("subscribes to the topics of its parameter `topics`, serialised",)
    TABLE = TABLE

    def __init__(self, **node_options: Any) -> None:
        super().__init__(**node_options)
        values = self.values
        self.experiment = experiment_description(values["experiment"], values["note"])
        compression = "" if values["compression"] == "none" else values["compression"]
        self.writer = RecordingWriter(
            values["output"] or Path("recordings") / time.strftime("%Y-%m-%d_%H-%M-%S"),
            experiment=self.experiment,
            compression=compression,
            durable=True,
            steady=self.wall.now,
            numbered=values["existing"] == "number" or not values["output"],
        )
        self.stop = False
        self._last = sys.maxsize  # ns of the machine's clock, up to which messages count
        self.armed: ArmedStart | None = None
        self._parent: ArmedStart | None = None  # heard again at the end
        self.problems: list[str] = []
        self.received: dict[str, int] = {}
        self.started = self._wall_seconds()
        self._deadline = self.started + (values["duration"] or float("inf"))
        self._next_log = self.started + LOG_PERIOD
        self._stored: dict[str, dict[str, Any]] = {}
        self._kept: dict[str, int] = {}  # stamped topic -> newest stamp, ns
        self._said: dict[str, Repetitions] = {}
        self._acknowledged = 0
        self._collector = ParameterCollector(self)
        # The topics have a node of their own, hidden by its name: this node's executor must not take them.
        self._input = Node(
            f"_{self.get_name()}_topics",
            namespace=self.get_namespace(),
            context=self.context,
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._topics = [
            RecordedTopic(
                self._input, name, KNOWN_TYPES.get(name), values["depth"], self._receive, self.time.simulated
            )
            for name in dict.fromkeys(self.resolve_topic_name(name) for name in values["topics"])
        ]
        self._space = FreeSpace(values["minimum_free_space"])
        self.warnings.watch(
            lambda: sum(topic.missed for topic in self._topics), "messages were lost on the way here"
        )
        self.warnings.watch(
            lambda: sum(topic.foreign for topic in self._topics),
            "messages of nodes that do not take part in this run were not recorded; stop those nodes, or "
            "give them another ROS_DOMAIN_ID",
        )
        steady_timer(self, FOLLOW_PERIOD, self._follow)
        self._follow()
        self.get_logger().info(f"recording to {self.writer.path}")

    def status_stamp(self) -> int:
        """In simulated time the newest that it has recorded: it is told of no tick."""
        return max(self._kept.values(), default=ORIGIN) if self.time.simulated else self.time.stamp()

    def state(self) -> str:
        return "stopping" if self.stop else "recording"

    def measurements(self) -> dict[str, Any]:
        return {**self.received, **{f"publishers of {topic.name}": topic.met for topic in self._topics}}

    def arm(self, armed: ArmedStart) -> None:
        """Waits from now on; to be called before the first message."""
        self.armed = self._parent = armed
        armed.ready(self._nodes, self._endpoints())

    def finish(self, executor: Executor) -> int:
        """Asks for the parameters once more, closes, and verifies the recording; 0 if it is whole, else 1."""
        ended = False
        by_parent: list[str] = []
        if self._parent is not None:
            for message in self._parent.link.receive():
                if "problem" in message:
                    by_parent.append(message["problem"])
                ended = ended or "ended" in message
        self.problems += by_parent
        self._collector.ask_again()
        self._take_the_last(executor)
        # First of all: whatever holds up the rest, what was received and lost is told.
        self._tell_reception(ended)
        told = len(self.problems)
        until = self._wall_seconds() + self.values["parameter_wait"]
        while self._collector.waiting and self._wall_seconds() < until:
            self.spin_once(executor)
            self._collector.poll()
        if self._collector.silent:
            silent = ", ".join(self._collector.silent)
            self.get_logger().warning(
                f"without the parameters of {silent}, which did not answer, at last "
                f"for {self.values['parameter_wait']:g} s: see whether a callback holds up its executor, or "
                "raise parameter_wait"
            )
        elapsed = self._wall_seconds() - self.started
        try:
            self._store_parameters()
            if self._collector.latest != self._collector.parameters:
                self.writer.describe(parameters_at_stop=self._with_own(self._collector.latest))
        except RecordingError as refusal:
            self._problem(str(refusal))
        if len(self.problems) > told:
            self._tell_reception(ended)
        try:
            self.writer.close()
            self.problems += verify_recording(self.writer.path, self.received)
        except RecordingError as refusal:
            self._problem(str(refusal))
        return print_verdict(self.writer.path, self._topics, self.received, self.problems, elapsed, by_parent)

    def _tell_reception(self, ended: bool) -> None:
        """Writes what was lost on the way here, whether the run came to its end, and what went wrong."""
        lost = {topic.name: topic.missed for topic in self._topics if topic.name in self.received}
        problems = {"problems": self.problems} if self.problems else {}
        try:
            self.writer.describe(reception={"lost_on_the_way": lost, "ended": ended, **problems})
        except RecordingError as refusal:
            self._problem(str(refusal))

    def _take_the_last(self, executor: Executor) -> None:
        """Takes what was sent before the end and is still on its way: on a busy machine a message arrives
        some time after its sender is gone. Of what is still being sent, nothing more."""
        self._last = time.time_ns()
        count, quiet = -1, 0
        for _ in range(LAST_LOOKS):
            self.spin_once(executor)
            quiet = quiet + 1 if count == (count := sum(self.received.values())) else 0
            if quiet == NOTHING_FOR:
                return

    def withdraw(self) -> int:
        """Removes the recording, which holds nothing because the start never came; 0."""
        self.writer.close()
        shutil.rmtree(self.writer.path)
        self.get_logger().info(f"nothing was started, so {self.writer.path} is removed")
        return 0

    def spin_once(self, executor: Executor) -> None:
        """One turn: callbacks of this node if there are any, then all messages that have arrived."""
        executor.spin_once(timeout_sec=DRAIN_PERIOD)
        begins = self.armed is not None and self.armed.poll()
        for topic in self._topics:
            topic.drain()
        if begins and self.armed is not None:
            # What was there before has been taken, and dropped; what comes from now on counts.
            self.armed.confirm()
            if self.time.simulated and self.armed.expected is not None:
                for topic in self._topics:
                    if topic.name in self.armed.expected[OUT]:
                        topic.only = processes_of(self.armed.expected)
            self.armed = None
            self.begin()
        if max(self._kept.values(), default=0) - self._acknowledged > ACKNOWLEDGED:
            self._acknowledge()

    def on_time_status(self, status: Status) -> None:
        self._acknowledge()

    def _acknowledge(self) -> None:
        """Tells the coordinator of simulated time what is kept, so that it does not run ahead."""
        if isinstance(self.time, SimulatedTime) and self.time.participant is not None:
            self._acknowledged = max(self._kept.values(), default=0)
            self.time.participant.recorded(self._kept)

    def shutdown_safely(self) -> None:
        self.time.close()
        try:
            self.writer.close()
        except RecordingError as refusal:
            self._problem(str(refusal))

    def leave_topics(self) -> None:
        """Ends its subscriptions; nothing is recorded from then on."""
        self._input.destroy_node()

    def leave_questions(self) -> None:
        """Gives up what was asked of other nodes."""
        self._collector.close()

    def begin(self) -> None:
        self.take_part(RECORDER, topics=tuple(topic.name for topic in self._topics))
        self.started = self._wall_seconds()
        self._deadline = self.started + (self.values["duration"] or float("inf"))
        self._next_log = self.started + LOG_PERIOD

    def _wall_seconds(self) -> float:
        return self.wall.now() * 1e-9

    def _now(self) -> float:
        """s, by which its duration counts."""
        if self.time.simulated:
            return self.started + seconds(max(self._kept.values(), default=ORIGIN))
        return self._wall_seconds()

    def _nodes(self) -> list[Node]:
        return [self, self._input]

    def _endpoints(self) -> Endpoints:
        """A topic of unknown type is subscribed to when a publisher has told its type."""
        found = endpoints(self._nodes())
        name = self._input.get_fully_qualified_name()
        for topic in self._topics:
            found[IN].setdefault(topic.name, [name])
        return found

    def _receive(self, topic: RecordedTopic, data: bytes, received: int, published: int) -> None:
        if self.armed is not None:
            return
        name = topic.name
        if published > self._last or (self.stop and self.problems):
            return  # too late, or the disk refuses; what is written stays readable
        try:
            if self.time.simulated:
                stamp = header_stamp(data) if topic.kind == JOINT_STATE else 0
                if stamp:
                    said = self._said.setdefault(name, Repetitions())
                    if said.is_one(stamp):
                        return
                    self._kept[name] = said.newest
                received = published = stamp or max(self._kept.values(), default=ORIGIN)
            if name not in self.received:
                self.writer.add_topic(name, topic.kind or "", qos=topic.profiles)
                self.received[name] = 0
            self.received[name] += 1
            self.writer.write(name, topic.kind or "", received, data, published)
        except RecordingError as refusal:
            self._problem(str(refusal))
            self.stop = True

    def _follow(self) -> None:
        for topic in self._topics:
            before = topic.problem
            topic.follow()
            if topic.problem != before:
                self._problem(topic.problem)
        if self.armed is None or self.armed.expecting:
            # Earlier, nodes are still compiling: they would answer a question that was given up long ago.
            self._collector.poll()
        self._store_parameters()
        try:
            self.writer.flush_older()
        except RecordingError as refusal:
            self._problem(str(refusal))
            self.stop = True
        if self.armed is not None:
            return
        now = self._now()
        free = shutil.disk_usage(self.writer.path).free
        if free < self.values["minimum_free_space"] and not self.stop:
            self._problem(
                f"{self.writer.path}: only {free / 1e6:.0f} MB are free, so the recording is ended: "
                "free space or lower minimum_free_space"
            )
            self.stop = True
        self.warnings.state("disk", self._space.warning(now, free))
        if now >= self._deadline and not self.stop:
            self.get_logger().info(f"its duration of {self.values['duration']:g} s is over")
            self.stop = True
        if sys.stderr.isatty():
            print(
                f"\r{now - self.started:7.1f} s  {self._counts()}", end="\x1b[K", file=sys.stderr, flush=True
            )
        elif now >= self._next_log:
            self._next_log += LOG_PERIOD
            self.get_logger().info(f"{now - self.started:.0f} s: {self._counts()}")

    def _store_parameters(self) -> None:
        if len(self._collector.parameters) == len(self._stored) and self._stored:
            return
        self._stored = dict(self._collector.parameters)
        try:
            self.writer.describe(parameters=self._with_own(self._stored), models=model_texts(self._stored))
        except RecordingError as refusal:
            self._problem(str(refusal))
            self.stop = True

    def _with_own(self, parameters: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        return {**parameters, self.get_fully_qualified_name(): dict(self.values)}

    def _counts(self) -> str:
        return "  ".join(f"{topic.name} {self.received.get(topic.name, 0)}" for topic in self._topics)

    def _problem(self, sentence: str) -> None:
        self.problems.append(sentence)
        self.warnings.state("problem", sentence)
        self.get_logger().error(sentence)


NODE = Recorder


def main(argv: Sequence[str] | None = None) -> int:
    """The executable: records until SIGINT, SIGTERM or `duration`; exit status 0 when the recording is
    verified."""
    return run_command(_main, argv)


def _main(argv: list[str]) -> int:
    if any(argument in ("-h", "--help") for argument in argv):
        print(node_help(Recorder))
        return 0
    argv, arguments, armed = read_arguments(argv)
    with stop_requests() as stop:
        rclpy.init(args=argv, signal_handler_options=SignalHandlerOptions.NO)
        try:
            (node,) = create_nodes([Recorder], arguments)
            assert isinstance(node, Recorder)
            executor = make_executor()
            executor.add_node(node)
            gc.collect()
            gc.freeze()
            if armed is not None:
                node.arm(armed)
            else:
                node.begin()
            status = 1
            try:
                while rclpy.ok() and not node.stop and not stop.is_set():
                    node.spin_once(executor)
                node.stop = True
                status = node.finish(executor) if node.armed is None else node.withdraw()
            except ExternalShutdownException:
                pass
            finally:
                node.shutdown_safely()
                with ends_within(LEAVING, status):
                    executor.remove_node(node)
                    executor.shutdown()
                    node.leave_topics()
                    node.leave_questions()
                    node.destroy_node()
                    rclpy.try_shutdown()
            return status
        finally:
            rclpy.try_shutdown()
