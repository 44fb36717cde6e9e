"""A start that waits: nodes exist, have compiled and know each other before the first sample is published.

    process: {"ready": its endpoints}     parent, when all are ready: {"expect": everybody's endpoints}
    process: {"waiting": [topics], "strangers": {topic: [nodes]}} ...    until it waits for none
    parent, when nobody waits: {"start": true}      process: {"started": true}, and runs
    parent, before it stops a process: {"cut_short": true}    where the coordinator of simulated time has gone

Without it the first seconds of an experiment are lost to whoever is discovered late: the middleware repeats a
discovery message that was lost only after seconds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.node import Node

from haptic_teleop_control.compiled import telling_compilation
from haptic_teleop_control.nodes.launching.connections import Endpoints, endpoints, strangers, unconnected
from haptic_teleop_control.nodes.launching.parent import ParentChannel

LOOK_INTERVAL = 0.1
"""Seconds between two looks at the graph."""


class ArmedStart:
    """The side of a process that was started with `parent.OPTION`; call `poll` until it returns True."""

    def __init__(self, link: ParentChannel) -> None:
        self.link = link
        self._nodes: Callable[[], Iterable[Node]] = list
        self._expected: Endpoints | None = None
        self._seen: dict[str, Any] = {}
        self._next_look = 0.0

    @contextmanager
    def telling_compilation(self) -> Iterator[None]:
        """Tells the parent when something is compiled within this block: that takes its time, once."""
        told = False

        def tell() -> None:
            nonlocal told
            if not told:
                told = True
                self.link.send(compiling=True)

        with telling_compilation(tell):
            yield

    def ready(self, nodes: Callable[[], Iterable[Node]], announced: Endpoints | None = None) -> None:
        """The nodes exist. `announced`: what they will have, where that is more than they have now."""
        self._nodes = nodes
        self.link.send(ready=endpoints(nodes()) if announced is None else announced)

    @property
    def expected(self) -> Endpoints | None:
        """What all processes of the run have; None before all are ready."""
        return self._expected

    @property
    def expecting(self) -> bool:
        """Whether all processes are ready, so that their nodes answer."""
        return self._expected is not None

    @property
    def abandoned(self) -> bool:
        """Whether the parent has gone."""
        return self.link.closed

    def poll(self) -> bool:
        """Takes what the parent says and tells it what is missing; True once when the start is there, which
        is then to be confirmed."""
        for message in self.link.receive():
            if "expect" in message:
                self._expected = message["expect"]
            if "start" in message:
                return True
        if self._expected is not None and time.monotonic() >= self._next_look:
            self._next_look = time.monotonic() + LOOK_INTERVAL
            nodes = list(self._nodes())
            seen = {
                "waiting": unconnected(nodes, self._expected),
                "strangers": strangers(nodes[0], self._expected),
            }
            if seen != self._seen:
                self._seen = seen
                self.link.send(**seen)
        return False

    def begin(self) -> bool:
        """`poll`, and `confirm` at once."""
        begins = self.poll()
        if begins:
            self.confirm()
        return begins

    def cut_short(self) -> bool:
        """Whether the parent has said that simulated time has no coordinator any more; asked once stopped."""
        return any("cut_short" in message for message in self.link.receive())

    def confirm(self) -> None:
        """Tells the parent that the start has been made; for a recorder, that others may follow."""
        self.link.send(started=True)
