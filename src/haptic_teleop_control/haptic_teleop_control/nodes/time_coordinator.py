"""The coordinator of simulated time as a node: grants ticks, publishes `/clock`, pauses and steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from rclpy.context import Context
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import TIME_COORDINATOR
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.nodes.timing.exchange import CoordinatorEnd
from haptic_teleop_control.nodes.timing.time_base import steady_timer
from haptic_teleop_control.simulated_time.coordinator import Coordinator
from haptic_teleop_control.simulated_time.messages import ENDED, HALTED, OVER, WAITING, Report, Status
from haptic_teleop_control.simulated_time.runs import own_run
from haptic_teleop_control.simulated_time.stamps import ORIGIN, seconds

POLL = 0.005
"""s between two looks at the wall: simulated time runs in steps of that length, never ahead of the wall."""

CLOCK_PERIOD = 10_000_000
"""ns of simulated time between two messages on /clock."""

HALT = "halted"

LISTENS = 1.0
"""s in which one that was started by hand looks for another coordinator before it takes anybody: nobody else
has looked, and what joins the wrong one of two hears no refusal of the other. `scenario` looks itself."""

SILENT = 3.0
"""s that it waits for participants before it says so: those of a scenario join within that."""


class TimeCoordinator(HapticNode):
    NAME = "time_coordinator"
    SUMMARY = "grants simulated time: the next tick when everybody has answered the last one"
    TOPICS = (
        "publishes  /clock                  rosgraph_msgs/Clock, 100 times per simulated second",
        "publishes  /simulated_time/tick    std_msgs/String, JSON: who acts at which stamp",
        "publishes  /simulated_time/status  std_msgs/String, JSON: who takes part, what is waited for",
        "subscribes /simulated_time/report  std_msgs/String, JSON: who has done what",
        "publishes  /diagnostics            simulated time, real-time factor achieved, what is waited for",
        "service    ~/pause                 std_srvs/Trigger: stop before the next tick",
        "service    ~/resume                std_srvs/Trigger: go on",
        "service    ~/step                  std_srvs/Trigger: one tick, while paused",
    )
    NOTES = (
        "`haptic-teleop scenario FILE` starts it where the file says use_sim_time: true. By hand:",
        "  haptic-teleop sfj_sim --ros-args -p use_sim_time:=true        (and so every node that takes part)",
        '  haptic-teleop time_coordinator --ros-args -p participants:="[sfj_sim]"',
        "Time begins when all are there. `haptic-teleop operate pause | step | resume` holds it.",
    )
    FAULTS: ClassVar = {HALT: "simulated time is halted; end the scenario and start it anew"}
    FINAL = frozenset({HALT})
    TABLE = TIME_COORDINATOR
    MAY_BE_SIMULATED = False  # it is the one that knows the wall

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        values = self.values
        self._coordinator = Coordinator(
            values["participants"],
            values["real_time_factor"],
            values["duration"],
            values["liveness"],
            armed=False,
            paused=values["paused"],
            run=own_run(),
            born=self.wall.stamp(),
            listens=0.0 if own_run() else LISTENS,
        )
        self._told = ORIGIN - CLOCK_PERIOD
        self._over = False
        self._begun = 0.0  # s of the steady clock
        self._awaited = ""  # what it has said that it waits for
        self._clock_out = self.create_publisher(Clock, "/clock", 10)
        self._end = CoordinatorEnd(self, self._hear, self._hear_other)
        for act in ("pause", "resume", "step"):
            self.create_service(Trigger, f"~/{act}", self._service(act))
        steady_timer(self, POLL, self._look)

    def start(self) -> None:
        self._coordinator.armed = True
        self._begun = self.wall.now() * 1e-9

    def _hear(self, report: Report) -> None:
        self._coordinator.hear(report, self.wall.now() * 1e-9)
        self._proceed()

    def _hear_other(self, status: Status) -> None:
        if self._coordinator.armed and self._coordinator.yields_to(status) and self.failure is None:
            self._end.announce(self._coordinator.give_way(), self._coordinator.members)
            taking_part = ", ".join(status.members) or "nobody yet"
            self.fail(
                ConfigurationError(
                    "another coordinator of simulated time is in this ROS domain (taking part: "
                    f"{taking_part}): stop one of them, or choose another ROS_DOMAIN_ID."
                )
            )

    def _look(self) -> None:
        self._end.run()
        self._proceed()
        self._tell_waiting()

    def _tell_waiting(self) -> None:
        """Whoever starts nodes by hand shall see what is lacking."""
        status = self._coordinator.status()
        missing = status.reason if status.state == WAITING else ""
        if missing == self._awaited or not self._coordinator.armed:
            return
        if missing and self.wall.now() * 1e-9 - self._begun < SILENT:
            return
        self._awaited = missing
        self.get_logger().info(missing or f"all participants are there: time is {status.state}")

    def _proceed(self) -> None:
        coordinator = self._coordinator
        if not coordinator.armed:
            return  # the scenario may yet be refused, and nobody else in the domain shall have heard of it
        for message in coordinator.poll(self.wall.now() * 1e-9):
            if isinstance(message, Status):
                self._tell_clock()
                if message.state == OVER and not self._over:
                    self._over = True
                    self.get_logger().info(f"time is over after {seconds(self._coordinator.stamp):.3f} s")
                    self.announce()  # the figures of the whole run, which a recording is to hold
                if message.state == HALTED and self.faults.latched is None:
                    self.fault(HALT, message.reason)
            elif message.stamp - self._told >= CLOCK_PERIOD:
                self._tell_clock()
            self._end.announce(message, coordinator.members)

    def _tell_clock(self) -> None:
        self._told = stamp = self._coordinator.stamp
        message = Clock()
        message.clock.sec, message.clock.nanosec = divmod(stamp, 10**9)
        self._clock_out.publish(message)

    def _service(self, act: str):
        def serve(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            refusal = getattr(self._coordinator, act)()
            self._proceed()  # first, so that it tells the time to which a step has come
            response.success = refusal is None
            done = f"{act}: done at {seconds(self._coordinator.stamp):.4f} s"
            response.message = f"{act}: refused: {refusal}" if refusal else done
            return response

        return serve

    def apply_parameters(self, values: Mapping[str, Any]) -> None:
        if values["real_time_factor"] != self._coordinator.pace.factor:
            self._coordinator.pace.factor = values["real_time_factor"]

    def status_stamp(self) -> int:
        """Of the time that it grants: it counts by the wall itself."""
        return self._coordinator.stamp

    def state(self) -> str:
        status = self._coordinator.status()
        return f"{status.state}: {status.reason}" if status.reason else status.state

    def measurements(self) -> dict[str, Any]:
        coordinator = self._coordinator
        return {
            "simulated time (s)": f"{seconds(coordinator.stamp):.3f}",
            "real-time factor": f"{coordinator.pace.achieved:.3f}",
            "real-time factor wanted": f"{coordinator.pace.factor:g}",
            "ticks": coordinator.ticks,
            "ticks asked for again": coordinator.repeats,
            "participants": ", ".join(coordinator.members),
        }

    def shutdown_safely(self) -> None:
        coordinator = self._coordinator
        if coordinator.armed and coordinator.state not in ENDED:
            self._end.announce(coordinator.end("the coordinator was stopped"), coordinator.members)
        self._end.close()


NODE = TimeCoordinator


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
