"""The parameters of every other node in the graph, asked by the parameter services and kept by parameter
events."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future

PATIENCE, AT_THE_END = 3.0, 0.2
"""s after which a question without an answer is put once more, while recording and at the end; twice as many
after every attempt in vain.

A node that compiles its plant at the first start answers nothing for ten seconds and more. And the middleware
drops an answer for a client that the node has not met yet, which a busy machine makes ordinary."""


class ParameterCollector:
    """`parameters` and `latest` (node -> name -> value) fill while `poll` is called and the node's executor
    runs.

    `parameters` holds what a node answered first, `latest` the same with all changes since. Nothing blocks: a
    node that does not answer is missing.
    """

    def __init__(self, node: Node, now: Callable[[], float] = time.monotonic) -> None:
        self.node = node
        self._now = now  # s
        self.parameters: dict[str, dict[str, Any]] = {}
        self.latest: dict[str, dict[str, Any]] = {}
        self._queries: dict[str, _Query] = {}
        self._done: list[_Query] | None = None  # kept from `ask_again` on
        node.create_subscription(
            ParameterEvent, "/parameter_events", self._event, qos_profile_parameter_events
        )

    @property
    def waiting(self) -> bool:
        """Whether an answer is outstanding of a node that was there at the last `poll`."""
        return bool(self._queries)

    @property
    def silent(self) -> list[str]:
        """Names of the nodes that were there at the last `poll`, were asked, and have not answered at all."""
        return sorted(n for n, q in self._queries.items() if q.asked and n not in self.parameters)

    def poll(self) -> None:
        """Asks the nodes that have appeared since, looks after the questions that are open, and gives up
        those to nodes that have gone."""
        own = self.node.get_fully_qualified_name()
        there = {
            f"{namespace.rstrip('/')}/{name}"
            for name, namespace in self.node.get_node_names_and_namespaces()
            # A leading underscore marks nodes that tools hide, such as the ros2 daemon.
            if not name.startswith("_")
        } - {own}
        for full in sorted(there - self.latest.keys()):
            self._ask(full)
        for full in self._queries.keys() - there:
            self._end(full)
        self._advance()

    def ask_again(self) -> None:
        """Asks every known node once more, its answer goes to `latest`, and puts open questions again. To be
        called at the end: from now on clients are kept until `close`, because the middleware may hold up
        whoever destroys one (see `forced_exit`), and a recording is still open here."""
        self._done = []
        for query in self._queries.values():
            query.hurry()
        for full in self.parameters:
            self._ask(full)
        self._advance()

    def close(self) -> None:
        """Gives up what is outstanding, and ends the clients of what is done."""
        for query in (*self._queries.values(), *(self._done or ())):
            query.destroy()
        self._queries.clear()
        self._done = None

    def _ask(self, full: str) -> None:
        if full not in self._queries:
            patience = PATIENCE if self._done is None else AT_THE_END
            self._queries[full] = _Query(self.node, full, patience)

    def _advance(self) -> None:
        for full, query in list(self._queries.items()):
            query.advance(self._now())
            if query.answer is not None:
                self.parameters.setdefault(full, query.answer)
                self.latest[full] = dict(query.answer)
                self._end(full)

    def _end(self, full: str) -> None:
        query = self._queries.pop(full)
        if self._done is None:
            query.destroy()
        else:
            self._done.append(query)

    def _event(self, event: ParameterEvent) -> None:
        known = self.latest.get(event.node)
        if known is None:
            return
        for parameter in [*event.new_parameters, *event.changed_parameters]:
            known[parameter.name] = _plain(parameter_value_to_python(parameter.value))
        for parameter in event.deleted_parameters:
            known.pop(parameter.name, None)


class _Query:
    """One node asked for the names, then for the values of its parameters; `answer` is None until both have
    come. Both questions are put again, by the same client, as long as nothing comes."""

    def __init__(self, node: Node, full: str, patience: float) -> None:
        self.node = node
        self.lister = node.create_client(ListParameters, f"{full}/list_parameters")
        self.getter = node.create_client(GetParameters, f"{full}/get_parameters")
        self.answer: dict[str, Any] | None = None
        self._names: list[str] | None = None
        self._asked: list[Future] = []
        self._patience, self._wait, self._again = patience, patience, math.inf

    @property
    def asked(self) -> bool:
        """Whether a question is open."""
        return bool(self._asked)

    def hurry(self) -> None:
        """From now on patience is that of the end, and an open question is put again at once."""
        self._patience, self._wait, self._again = AT_THE_END, 0.5 * AT_THE_END, -math.inf

    def advance(self, now: float) -> None:
        """Takes the next step if it can be taken; ``now``: s."""
        done = next((one.result() for one in self._asked if one.done()), None)
        if done is None:
            self._put(now)
        elif self._names is None:
            self._names, self._asked, self._wait = list(done.result.names), [], self._patience
            self._put(now)
        else:
            values = map(parameter_value_to_python, done.values)
            self.answer = {name: _plain(value) for name, value in zip(self._names, values, strict=False)}

    def _put(self, now: float) -> None:
        if not (self.lister.service_is_ready() and self.getter.service_is_ready()):
            return
        if self._asked:
            if now < self._again:
                return
            self._wait *= 2.0
        self._again = now + self._wait
        if self._names is None:
            self._asked.append(self.lister.call_async(ListParameters.Request()))
        else:
            self._asked.append(self.getter.call_async(GetParameters.Request(names=self._names)))

    def destroy(self) -> None:
        self.node.destroy_client(self.lister)
        self.node.destroy_client(self.getter)


def _plain(value: Any) -> Any:
    """The value as JSON can hold it."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return list(value)
