"""What all nodes of this project share: parameters from a table, a fault latch with `~/reset`, diagnostics
at 1 Hz, and at once when a fault latches or is reset.

A subclass states `NAME`, `NAMESPACE`, `SUMMARY`, `TOPICS` and `TABLE`; `run.run_node` and `composed` need
no more to print its help, check its parameters and run it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.faults import FaultLatch
from haptic_teleop_control.nodes.base.parameters import declare_parameters
from haptic_teleop_control.nodes.streams.senders import crowded
from haptic_teleop_control.nodes.timing.time_base import (
    SIMULATED_TIME,
    TIME_FAULTS,
    SimulatedTime,
    TimeBase,
    WallTime,
    steady_timer,
)
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.simulated_time.messages import Member, Status, Tick
from haptic_teleop_control.warning_list import DEADLINE_SHARE, Warnings

if TYPE_CHECKING:
    from haptic_teleop_control.nodes.timing.deadline import DeadlineThread

LOG_INTERVAL = 1_000_000_000
"""ns between two log lines of one kind of fault."""


class HapticNode(Node):
    """An rclpy node with parameters (`self.values`), faults (`self.faults`), rates and an orderly end.

    time: that of the experiment, the wall's or simulated. wall: that of the wall, for what serves the
    operator in both; given by a test that holds it.
    """

    NAME: ClassVar[str]
    NAMESPACE: ClassVar[str] = ""
    SUMMARY: ClassVar[str]
    TOPICS: ClassVar[tuple[str, ...]] = ()
    NOTES: ClassVar[tuple[str, ...]] = ()  # further lines of --help
    FAULTS: ClassVar[Mapping[str, str]] = {}
    FINAL: ClassVar[frozenset[str]] = frozenset(TIME_FAULTS)  # those that no reset releases
    TABLE: ClassVar[ParameterTable]
    MAY_BE_SIMULATED: ClassVar[bool] = True

    def __init__(
        self, context: Context | None = None, wall: WallTime | None = None, **node_options: Any
    ) -> None:
        options = {"namespace": self.NAMESPACE, **node_options}
        super().__init__(self.NAME, context=context, **options)
        self.full_name = self.get_fully_qualified_name()
        self.failure: BaseException | None = None
        self.wall = wall or WallTime()
        self._last_log: dict[str, int] = {}
        self._counters: dict[str, Callable[[], int]] = {}
        self._last_counts: dict[str, int] = {}
        self._rates: dict[str, str] = {}
        self._unsaid: deque[str] = deque()  # sentences of latched faults that are not yet published
        self._last_report = self.wall.now()
        self.values = declare_parameters(self, self.TABLE)
        simulated = bool(self.values.get("use_sim_time")) and self.MAY_BE_SIMULATED
        self.time: TimeBase = SimulatedTime(self, self.wall) if simulated else self.wall
        self.faults = FaultLatch({**self.FAULTS, **TIME_FAULTS} if simulated else self.FAULTS)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.warnings = Warnings()
        for name in self.FAULTS:
            self.warnings.watch(
                lambda name=name: self.faults.counts[name], f"x {name}, reset since"
            )
        self._report_timer = steady_timer(self, 1.0, self._report)
        if self.FAULTS:
            self.create_service(Trigger, "~/reset", self._reset)

    # What subclasses override.

    def apply_parameters(self, values: Mapping[str, Any]) -> None:
        """Takes all parameter values after a change; raises ConfigurationError to refuse it."""

    def start(self) -> None:
        """Starts threads; called once, when all nodes of the process exist and its executor is about to
        run."""

    def on_reset(self) -> None:
        """Called when a latched fault is reset, before the output comes back."""

    def state(self) -> str:
        """What the node is doing, for diagnostics; a few words."""
        return "running"

    def measurements(self) -> dict[str, Any]:
        """Further values for diagnostics."""
        return {}

    def shutdown_safely(self) -> None:
        """Stops threads, publishes and sends zero output; called once, before the node is destroyed."""

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        """Simulated time has come to `tick.stamp`; repeated: something was lost, so say again what you
        said."""

    def on_time_fault(self, detail: str) -> None:
        """Simulated time has ended: the output is zero from now on."""
        self.fault(SIMULATED_TIME, detail)

    def on_time_refused(self, detail: str) -> None:
        """Simulated time does not take this node: it has done nothing yet, and ends."""
        self.fail(ConfigurationError(detail))

    def on_time_status(self, status: Status) -> None:
        """What the coordinator of simulated time says of itself."""

    # What subclasses use.

    def take_part(self, kind: str, **what: Any) -> None:
        """Joins simulated time as a `Member` of this kind; does nothing in real time."""
        if isinstance(self.time, SimulatedTime):
            member = Member(self.full_name, kind, **what)
            self.time.take_part(
                member, self.on_tick, self.on_time_fault, self.on_time_refused, self.on_time_status
            )

    def fault(self, name: str, detail: str) -> None:
        """Counts a fault; logs and publishes the one that latches, and logs repetitions at most once a
        second. From any thread."""
        latches = self.faults.count(name, detail)
        now = self.wall.now()
        if latches:
            self._unsaid.append(self.faults.describe(name, detail))
            self.announce()
            remedy = "" if name in self.FINAL else f" Output is zero until {self.full_name}/reset"
            self.get_logger().error(f"FAULT {self.faults.describe(name, detail)}{remedy}")
        elif now - self._last_log.get(name, 0) > LOG_INTERVAL:
            count = self.faults.counts[name]
            self.get_logger().warning(f"{self.faults.describe(name, detail)} Counted {count} times so far")
        else:
            return
        self._last_log[name] = now

    def announce(self) -> None:
        """Has the executor publish at its next turn what has latched or was released. From any thread: the
        loop that found the fault neither builds the message nor waits for it."""
        executor = self.executor
        if executor is not None:
            executor.create_task(self._announce)

    def fail(self, failure: BaseException) -> None:
        """An error of the program in a thread of this node, or a refusal that comes only now: the process
        ends, safely, with this error."""
        self.failure = failure

    def count_rate(self, name: str, counter: Callable[[], int]) -> None:
        """Adds a rate (events per second of `counter`) to the diagnostics."""
        self._counters[name] = counter
        self._last_counts[name] = counter()
        self._rates[f"{name} (Hz)"] = "0.0"

    def watch_periods(self, thread: DeadlineThread) -> None:
        """Warns when a thread skips more than DEADLINE_SHARE of its periods."""
        self.warnings.watch(
            lambda: thread.overruns,
            "periods were skipped: the machine is too busy; stop other programs, or set realtime_priority",
            lambda: thread.cycles + thread.overruns,
            DEADLINE_SHARE,
        )

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self.faults.latched in self.FINAL:
            response.success, response.message = False, f"a reset does not help: {self.faults.sentence}"
            return response
        released = self.faults.reset()
        self.on_reset()
        self._last_log.clear()
        response.success = True
        response.message = f"{released} reset" if released else "no fault was latched"
        self.get_logger().info(response.message)
        self._announce()
        return response

    def _announce(self) -> None:
        """Publishes every fault that has latched since, also one that was reset meanwhile, so that nobody
        misses it; then that none is latched, if so."""
        while self._unsaid:
            self._publish_status(DiagnosticStatus.ERROR, self._unsaid.popleft(), self._status_values())
        if not self.faults.latched:
            self._publish_status(DiagnosticStatus.OK, self._doing(), self._status_values())

    def _report(self) -> None:
        now = self.wall.now()
        elapsed, self._last_report = (now - self._last_report) * 1e-9, now
        for name, counter in self._counters.items():
            count = counter()
            if elapsed > 0.0:
                self._rates[f"{name} (Hz)"] = f"{(count - self._last_counts[name]) / elapsed:.1f}"
            self._last_counts[name] = count
        values = self._status_values()  # before the warnings: looking may find something to warn of
        warnings = [*self.warnings.take(), *crowded(self, JointState)]
        level, sentence = DiagnosticStatus.OK, self._doing()
        if latched := self.faults.sentence:
            level, sentence = DiagnosticStatus.ERROR, latched
        elif warnings:
            level, sentence = DiagnosticStatus.WARN, "; ".join(warnings)
        self._publish_status(level, sentence, values)

    def _doing(self) -> str:
        """`state`, or what simulated time waits for before it begins."""
        waits_for = self.time.waits_for if isinstance(self.time, SimulatedTime) else ""
        return f"waiting for {waits_for}" if waits_for else self.state()

    def _status_values(self) -> dict[str, Any]:
        values: dict[str, Any] = {"state": self._doing(), **self._rates, **self.measurements()}
        values.update({f"fault {name}": count for name, count in self.faults.counts.items()})
        return values

    def status_stamp(self) -> int:
        """ns that `/diagnostics` is stamped with."""
        return self.time.stamp()

    def _publish_status(self, level: bytes, sentence: str, values: dict[str, Any]) -> None:
        status = DiagnosticStatus(
            level=level,
            name=self.get_fully_qualified_name(),
            message=sentence,
            hardware_id="haptic_teleop",
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self.status_stamp(), 10**9)
        self._diagnostics.publish(message)
