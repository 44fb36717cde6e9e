"""The link between master and slave as a node: everything that the controller sends passes through it, and is
delayed, lost, repeated or overtaken as the parameters say."""

from __future__ import annotations

import heapq
import threading
from functools import partial
from typing import Any, ClassVar

from rclpy.context import Context

from haptic_teleop_control.faults import SECOND_SENDER, SECOND_SENDER_SENTENCE
from haptic_teleop_control.node_tables import LINK
from haptic_teleop_control.nodes.base.haptic_node import HapticNode
from haptic_teleop_control.nodes.base.run import run_node
from haptic_teleop_control.nodes.streams.joint_states import JointStatePublisher, JointStateReceiver
from haptic_teleop_control.nodes.timing.time_base import SimulatedTime
from haptic_teleop_control.quantities import from_parameters
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.simulated_time.messages import LINK as LINK_MEMBER
from haptic_teleop_control.simulated_time.messages import Tick
from haptic_teleop_control.simulated_time.stamps import ORIGIN, seconds
from haptic_teleop_control.teleoperation.link_model import LinkChannel, LinkSettings

FIELDS = ("velocity", "effort")
WAYS = ("master", "slave")
"""The two directions, named by who sends; their numbers choose the random sequences."""


class LinkEmulator(HapticNode):
    NAME = "link"
    SUMMARY = "the network between master and slave: seeded delay, jitter, loss, reordering, duplicates"
    TOPICS = (
        "subscribes teleoperation/master, teleoperation/slave            what the controller's sides send",
        "publishes  link/teleoperation/master, link/teleoperation/slave  the same, as it arrives",
        "service    ~/reset       std_srvs/Trigger: leave a latched fault, in which nothing is delivered",
        "publishes  /diagnostics  packets sent, lost, repeated and delivered, worst lateness of a delivery",
    )
    FAULTS: ClassVar = {SECOND_SENDER: SECOND_SENDER_SENTENCE}
    TABLE = LINK

    def __init__(self, context: Context | None = None, **node_options: Any) -> None:
        super().__init__(context, **node_options)
        settings = from_parameters(LinkSettings, self.values)
        self._channels = [LinkChannel(settings, number) for number in range(len(WAYS))]
        self._out = [JointStatePublisher(self, f"link/teleoperation/{way}", STAGES, FIELDS) for way in WAYS]
        self._in: list[JointStateReceiver] = []
        for number, way in enumerate(WAYS):
            take = partial(self._take, number)
            self._in.append(
                JointStateReceiver(
                    self, f"teleoperation/{way}", STAGES, FIELDS, take, self._on_problem, listening=False
                )
            )
        self._topics = [source.topic for source in self._in]
        self._taken: list[tuple[int, list[int]] | None] = [None] * len(WAYS)  # stamp and arrivals of the last
        self._packets: dict[tuple[int, int], list[Any]] = {}  # way and stamp -> copies to come, values
        # due ns, order of arrival here, way, stamp, values of FIELDS
        self._under_way: list[tuple[int, int, int, int, list[list[float]]]] = []
        self._changed = threading.Condition()
        self._order = 0
        self._stopped = False
        self.delivered = self.refused = 0
        self.worst_lateness = 0.0
        self._thread = threading.Thread(target=self._run, name=self.NAME, daemon=True)
        self.warnings.watch(
            lambda: self.refused, "packets had wrong joints or values that are no numbers: not delivered"
        )
        self.count_rate("packets delivered", lambda: self.delivered)

    def start(self) -> None:
        for source in self._in:
            source.listen()
        if self.time.simulated:
            self.take_part(LINK_MEMBER, topics=tuple(source.topic for source in self._in))
        else:
            self._thread.start()

    def on_reset(self) -> None:
        for source in self._in:
            source.forget()

    def _on_problem(self, kind: str, detail: str, stamp: int) -> None:
        if kind == SECOND_SENDER:
            self.fault(SECOND_SENDER, detail)
        else:
            self.refused += 1

    # Simulated time: what arrives when is told to the coordinator, who says when it is handed over.

    def on_tick(self, tick: Tick, repeated: bool) -> None:
        if repeated:
            for number, taken in enumerate(self._taken):
                if taken is not None:
                    self._tell(number, *taken)
        else:
            self._packets = {key: packet for key, packet in self._packets.items() if packet[0] > 0}
        for way, sent, _ in tick.deliveries:
            number = self._topics.index(way)
            packet = self._packets.get((number, sent))
            if packet is None:
                continue
            if not repeated:
                packet[0] -= 1
                self.delivered += 1
            out = self._out[number]
            for field, content in zip(FIELDS, packet[1], strict=True):
                out.view[field][:] = content
            out.send(sent)

    def _take_simulated(self, number: int) -> None:
        source = self._in[number]
        last = self._taken[number]
        if last is None or source.stamp > last[0]:
            arrivals = [] if self.faults.latched else self._channels[number].transmit(seconds(source.stamp))
            last = self._taken[number] = (source.stamp, [ORIGIN + round(at * 1e9) for at in arrivals])
            if arrivals:
                values = [source.value[field].copy() for field in FIELDS]
                self._packets[number, source.stamp] = [len(arrivals), values]
        self._tell(number, *last)

    def _tell(self, number: int, sent: int, arrivals: list[int]) -> None:
        if isinstance(self.time, SimulatedTime) and self.time.participant is not None:
            self.time.participant.taken(self._topics[number], sent, tuple(arrivals))

    # Real time.

    def _take(self, number: int) -> None:
        if self.time.simulated:
            self._take_simulated(number)
            return
        if self.faults.latched:
            return
        source = self._in[number]
        arrivals = self._channels[number].transmit(source.received * 1e-9)
        values = [source.value[field].tolist() for field in FIELDS]
        with self._changed:
            for arrival in arrivals:
                self._order += 1
                packet = (round(arrival * 1e9), self._order, number, source.stamp, values)
                heapq.heappush(self._under_way, packet)
            self._changed.notify()

    def _run(self) -> None:
        try:
            while (packet := self._next()) is not None:
                due, _, number, stamp, values = packet
                out = self._out[number]
                for field, content in zip(FIELDS, values, strict=True):
                    out.view[field][:] = content
                out.send(stamp)
                self.delivered += 1
                self.worst_lateness = max(self.worst_lateness, (self.time.now() - due) * 1e-9)
        except Exception as failure:
            self.fail(failure)

    def _next(self) -> tuple[int, int, int, int, list[list[float]]] | None:
        """The packet that is due, once it is; None at the end."""
        with self._changed:
            while not self._stopped:
                due = self._under_way[0][0] if self._under_way else None
                if due is not None and due <= self.wall.now():
                    return heapq.heappop(self._under_way)
                self.wall.wait(self._changed, due)
        return None

    def measurements(self) -> dict[str, Any]:
        values: dict[str, Any] = {}
        if not self.time.simulated:
            values["worst lateness (ms)"] = f"{1e3 * self.worst_lateness:.2f}"
        for way, channel in zip(WAYS, self._channels, strict=True):
            values[f"from the {way}"] = f"{channel.sent} sent, {channel.lost} lost, {channel.repeated} twice"
        return values

    def shutdown_safely(self) -> None:
        with self._changed:
            self._stopped = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join(1.0)
        self.time.close()


NODE = LinkEmulator


def main(argv: list[str] | None = None) -> int:
    return run_node(NODE, argv)
