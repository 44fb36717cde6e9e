"""Starting armed processes together: the parent's side of `arming`."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rclpy.node import Node

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.launching.children import Child
from haptic_teleop_control.nodes.launching.connections import (
    Endpoints,
    endpoints,
    merged,
    processes_of,
    strangers,
    unconnected,
)
from haptic_teleop_control.nodes.launching.run_node import RunNode

START_INTERVAL = 0.02
"""Seconds between two looks at the children until they have started."""

DISCOVERY_TIME = 3.5
"""Seconds from the start within which every other participant of the domain has announced itself: they do so
every three seconds, and a first announcement that gets lost is not repeated sooner."""

UNKNOWN_RUN, LATER_RUN = DISCOVERY_TIME, 15.0
"""Seconds that one waits for others to leave our topics: until one knows whether they belong to a run,
and until a run that was begun later has been refused."""

CONNECT_LIMIT, SIMULATED_CONNECT_LIMIT = 15.0, 60.0
"""Seconds that processes which are ready are given to find each other; then it goes on without. Simulated
time can wait, and what a recorder had not met before the start would be missing in the recording."""


class Starter:
    """Leads `children` to their common start; `watching` is a node of this process that shall hear them, too.

    run: this run as others see it.
    done: the last of them has been told to start. missing: topics on which somebody had not met somebody
    else by then. line: what is being waited for.
    """

    def __init__(
        self, children: Sequence[Child], watching: Node, simulated: bool = False, run: RunNode | None = None
    ) -> None:
        self._run = run
        self._disturbed: float | None = None
        self._others_seen = False
        self._limit = SIMULATED_CONNECT_LIMIT if simulated else CONNECT_LIMIT
        self._children, self._watching = list(children), watching
        self._ready: dict[str, Endpoints] = {}
        self._waiting: dict[str, list[str]] = {}
        self._strangers: dict[str, dict[str, list[str]]] = {}
        self._started: set[str] = set()
        self._told: set[str] = set()
        self._compiling = False
        self._expected: Endpoints | None = None
        self._deadline = 0.0
        self._all_announced = time.monotonic() + DISCOVERY_TIME
        self.missing: list[str] = []
        self.done = False

    @property
    def line(self) -> str:
        """One line for the progress."""
        if self._expected is None:
            waited = [child.name for child in self._children if child.name not in self._ready]
            if self._compiling:
                return f"compiling, once, some 20 s: {', '.join(waited)}"
            return f"starting {', '.join(waited)}"
        if self._disturbed is not None:
            topics = sorted({topic for seen in self._strangers.values() for topic in seen})
            return f"somebody else publishes on {', '.join(topics)}: waiting for them to go"
        return " ".join(["waiting until all know each other", *self._unmet()])

    @property
    def processes(self) -> frozenset[str]:
        """The ids of all processes of the run; none before all are ready, or where none are told."""
        return frozenset() if self._expected is None else processes_of(self._expected)

    @property
    def warning(self) -> str:
        """What it means that something is missing."""
        topics = ", ".join(self.missing)
        return (
            f"after {self._limit:g} s not all processes had found each other on {topics}, so the first "
            "samples there may be missing; it goes on. Look at the machine's load and its network settings"
        )

    def poll(self) -> None:
        """Takes what the children say, and tells them what comes next; never waits.

        Raises ConfigurationError before the start when a node that is not ours publishes on a topic of ours.
        """
        for child in self._children:
            for message in child.link.receive():
                self._take(child.name, message)
        if self._expected is None:
            if len(self._ready) == len(self._children):
                self._expect()
        elif not self._told:
            self._waiting[""] = unconnected([self._watching], self._expected)
            now = time.monotonic()
            connected = len(self._waiting) > len(self._children) and not self._unmet()
            if now > self._deadline or (connected and now > self._all_announced):
                if not self._alone(self._expected):
                    return
                self.missing = self._unmet()
                self._tell(self._children[-1])  # the recorder, if there is one: it has to be there first
        elif self._told == self._started:
            rest = [child for child in self._children if child.name not in self._told]
            for child in rest:
                self._tell(child)
            self.done = True

    def _take(self, name: str, message: dict) -> None:
        self._compiling = self._compiling or "compiling" in message
        if "ready" in message:
            self._ready[name] = message["ready"]
        if "waiting" in message:
            self._waiting[name] = message["waiting"]
            self._strangers[name] = message["strangers"]
        if "started" in message:
            self._started.add(name)

    def _expect(self) -> None:
        self._expected = merged([*self._ready.values(), endpoints([self._watching])])
        self._deadline = time.monotonic() + self._limit
        for child in self._children:
            child.link.send(expect=self._expected)

    def _alone(self, ours: Endpoints) -> bool:
        """Whether nobody else publishes on our topics. Of two runs that were started together the earlier one
        waits until the later one has been refused."""
        # Whoever sees one is right: discovery may be late in this process and not in another.
        self._strangers[""] = strangers(self._watching, ours)
        found = sorted(pair for seen in self._strangers.values() for pair in seen.items())
        if not found:
            self._disturbed, self._others_seen = None, False
            return True
        now = time.monotonic()
        self._disturbed = self._disturbed or now
        others = [] if self._run is None else self._run.others()
        earlier = self._run is not None and any(other < self._run.key for other in others)
        # A run that leaves is gone from the graph before the last of its processes is.
        self._others_seen = self._others_seen or bool(others)
        if not earlier and now - self._disturbed < (LATER_RUN if self._others_seen else UNKNOWN_RUN):
            return False
        topic, names = found[0]
        raise ConfigurationError(
            f"{topic} is also published by {', '.join(names)}{', of a run begun before' if earlier else ''}: "
            "stop that, or choose another ROS_DOMAIN_ID. What was killed is listed for some 20 s more."
        )

    def _tell(self, child: Child) -> None:
        self._told.add(child.name)
        child.link.send(start=True)

    def _unmet(self) -> list[str]:
        return sorted({topic for topics in self._waiting.values() for topic in topics})
