"""One topic that is recorded: a serialised subscription that fits whatever its publishers offer."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from haptic_teleop_control.nodes.streams.senders import process_of
from haptic_teleop_control.nodes.timing.time_base import EVERY_QOS
from haptic_teleop_control.recorder_parameters import JOINT_STATE

Receive = Callable[["RecordedTopic", bytes, int, int], None]
Wanted = tuple[ReliabilityPolicy, LivelinessPolicy]

_ANYTHING: Wanted = (ReliabilityPolicy.BEST_EFFORT, LivelinessPolicy.AUTOMATIC)
_RELIABLE: Wanted = (ReliabilityPolicy.RELIABLE, LivelinessPolicy.AUTOMATIC)
_OF_SIMULATED_TIME: Wanted = (EVERY_QOS.reliability, EVERY_QOS.liveliness)


class RecordedTopic:
    """Subscribes to `name`; `drain` hands each message to `receive(topic, data, received ns, published ns)`.

    Before a publisher is known it subscribes best effort, which any publisher can serve. When `follow` finds
    that all publishers are reliable it changes to a reliable subscription, and back, without a gap and
    without taking a message twice. In `simulated` time it is reliable where any publisher is, and joint
    states of nodes that go by the wall are not heard (see `EVERY_QOS`). only: ids of processes whose messages
    are taken, if not all; `foreign` counts others. A type that is not known in advance is taken from the
    publishers. `problem` is a sentence or empty; `missed` counts messages that the publishers numbered but
    that did not arrive.

    `node` must not be in an executor: messages are taken here in batches, at a fraction of the cost of one
    callback each, and with the middleware's own time of reception.
    """

    def __init__(
        self, node: Node, name: str, kind: str | None, depth: int, receive: Receive, simulated: bool = False
    ) -> None:
        self.node, self.name, self.kind, self.depth = node, name, kind, depth
        self.receive = receive
        self.problem = ""
        self.profiles: list[dict[str, Any]] = []
        self.missed = 0
        self.foreign = 0
        self.only: frozenset[str] = frozenset()
        self._simulated = simulated
        self._wanted = _ANYTHING
        self._class: type | None = None
        self._subscription = None
        self._outgoing = None
        self._boundary: int | None = None
        self._last_published = 0
        self._sequence: dict[bytes, int] = {}
        if kind is not None:
            of_simulated_time = _OF_SIMULATED_TIME if kind == JOINT_STATE else _RELIABLE
            self._subscribe(of_simulated_time if simulated else _ANYTHING)

    @property
    def publishers(self) -> int:
        return len(self.profiles)

    @property
    def met(self) -> str:
        """From how many publishers it receives by now, and with which quality of service."""
        if self._subscription is None:
            return "0"
        count = self._subscription.get_publisher_count()
        reliable = self._wanted[0] == ReliabilityPolicy.RELIABLE
        return f"{count} ({'reliable' if reliable else 'best effort'})"

    def follow(self) -> None:
        """Adapts to the publishers that there are now."""
        offers = self.node.get_publishers_info_by_topic(self.name)
        if not offers:
            return
        self.profiles = [_profile(offer) for offer in offers]
        if self.kind is None:
            self.kind = offers[0].topic_type
        if others := {offer.topic_type for offer in offers} - {self.kind}:
            self.problem = (
                f"{self.name} is also published as {', '.join(sorted(others))}, which is not recorded"
            )
        wanted = self._served([offer.qos_profile for offer in offers])
        if self._subscription is None or wanted != self._wanted:
            self._subscribe(wanted)
        elif self._boundary is not None:
            self._drop_outgoing()

    def drain(self) -> None:
        """Takes all messages that have arrived."""
        if self._outgoing is not None:
            for data, info in _taken(self._outgoing, self._class):
                if self._boundary is None or info["source_timestamp"] < self._boundary:
                    self._take(data, info)
        if self._subscription is None:
            return
        for data, info in _taken(self._subscription, self._class):
            published = info["source_timestamp"]
            if self._boundary is None:
                # From here on this subscription delivers; what the one before it had is not taken twice.
                self._boundary = max(published, self._last_published + 1) if self._outgoing else 0
            if published >= self._boundary:
                self._take(data, info)

    def _served(self, offers: Sequence[QoSProfile]) -> Wanted:
        if self._simulated and self.kind == JOINT_STATE:
            return _OF_SIMULATED_TIME
        of_all = any if self._simulated else all
        reliable = of_all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
        return _RELIABLE if reliable else _ANYTHING

    def _subscribe(self, wanted: Wanted) -> None:
        self._class = _message_class(self.kind or "")
        if self._class is None:
            self.problem = (
                f"{self.name} cannot be recorded: the messages of {self.kind} are not installed here"
            )
            return
        profile = QoSProfile(
            reliability=wanted[0],
            liveliness=wanted[1],
            durability=DurabilityPolicy.VOLATILE,
            history=HistoryPolicy.KEEP_LAST,
            depth=self.depth,
        )
        # The old subscription stays until the new one delivers: until then that has not met the publishers.
        if self._outgoing is not None and self._boundary is None and self._subscription is not None:
            self.node.destroy_subscription(self._subscription)  # one that has not, either
        else:
            self._drop_outgoing()
            self._outgoing = self._subscription
        self._wanted, self._boundary = wanted, None
        self._subscription = self.node.create_subscription(self._class, self.name, _never, profile, raw=True)

    def _drop_outgoing(self) -> None:
        if self._outgoing is not None:
            self.node.destroy_subscription(self._outgoing)
            self._outgoing = None

    def _take(self, data: bytes, info: dict[str, Any]) -> None:
        if self.only and (process := process_of(info)) and process not in self.only:
            self.foreign += 1
            return
        self._last_published = info["source_timestamp"]
        self._count_missed(info)
        self.receive(self, data, info["received_timestamp"], self._last_published)

    def _count_missed(self, info: dict[str, Any]) -> None:
        number = info.get("publication_sequence_number")
        sender = info.get("publisher_gid")
        if number is None or (sender is None and self.publishers > 1):
            return  # a middleware that does not count, or an rclpy (7.1) that does not say who has counted
        publisher = b"" if sender is None else sender["data"]
        last = self._sequence.get(publisher)
        if last is not None and number > last + 1:
            self.missed += number - last - 1
        self._sequence[publisher] = number


def _never(_: bytes) -> None:
    """The callback that is never called."""


def _taken(subscription: Subscription, kind: type | None) -> Iterator[tuple[bytes, dict[str, Any]]]:
    while (taken := subscription.handle.take_message(kind, True)) is not None:
        yield taken


def _message_class(kind: str) -> type | None:
    package, _, name = kind.partition("/msg/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError, ValueError):
        return None


def _profile(offer: TopicEndpointInfo) -> dict[str, Any]:
    """An offered quality of service as rosbag2 writes it."""
    qos = offer.qos_profile

    def span(duration) -> dict[str, int]:
        return dict(zip(("sec", "nsec"), divmod(duration.nanoseconds, 1_000_000_000), strict=True))

    return {
        "history": qos.history.short_key,
        "depth": qos.depth,
        "reliability": qos.reliability.short_key,
        "durability": qos.durability.short_key,
        "deadline": span(qos.deadline),
        "lifespan": span(qos.lifespan),
        "liveliness": qos.liveliness.short_key,
        "liveliness_lease_duration": span(qos.liveliness_lease_duration),
        "avoid_ros_namespace_conventions": bool(qos.avoid_ros_namespace_conventions),
    }
