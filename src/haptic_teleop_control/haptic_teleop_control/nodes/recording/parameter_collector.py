"""The parameters of every other node in the graph, asked by the parameter services and kept by parameter
events."""

from __future__ import annotations

from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import qos_profile_parameter_events

PATIENCE = 30
"""Polls after which a node that has not answered is asked anew; twice as many after every attempt in vain.

A node that compiles its plant at the first start answers nothing for ten seconds and more."""


class ParameterCollector:
    """`parameters` and `latest` (node -> name -> value) fill while `poll` is called and the node's executor
    runs.

    `parameters` holds what a node answered first, `latest` the same with all changes since. Nothing blocks: a
    node that does not answer is missing.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.parameters: dict[str, dict[str, Any]] = {}
        self.latest: dict[str, dict[str, Any]] = {}
        self._queries: dict[str, _Query] = {}
        self._answered: list[_Query] | None = None  # kept from `ask_again` on
        self._vain: dict[str, int] = {}
        node.create_subscription(
            ParameterEvent, "/parameter_events", self._event, qos_profile_parameter_events
        )

    @property
    def waiting(self) -> bool:
        """Whether an answer is outstanding."""
        return bool(self._queries)

    def poll(self) -> None:
        """Asks the nodes that have appeared since, and looks after the questions that are open."""
        own = self.node.get_fully_qualified_name()
        for name, namespace in self.node.get_node_names_and_namespaces():
            full = f"{namespace.rstrip('/')}/{name}"
            # A leading underscore marks nodes that tools hide, such as the ros2 daemon.
            if full != own and not name.startswith("_") and full not in self.latest:
                self._ask(full)
        self._advance()

    def ask_again(self) -> None:
        """Asks every known node once more; its answer goes to `latest`. To be called at the end: from now on
        clients are kept until `close`, because the middleware may hold up whoever destroys one (see
        `forced_exit`), and a recording is still open here."""
        self._answered = []
        for full in self.parameters:
            self._ask(full)
        self._advance()

    def close(self) -> None:
        """Gives up what is outstanding, and ends the clients of what was answered."""
        for query in (*self._queries.values(), *(self._answered or ())):
            query.destroy()
        self._queries.clear()
        self._answered = None

    def _ask(self, full: str) -> None:
        if full not in self._queries:
            self._queries[full] = _Query(self.node, full)

    def _advance(self) -> None:
        for full, query in list(self._queries.items()):
            query.advance()
            if query.answer is None and query.polls < PATIENCE * 2 ** self._vain.get(full, 0):
                continue
            if query.answer is not None:
                self.parameters.setdefault(full, query.answer)
                self.latest[full] = dict(query.answer)
            elif full not in self.parameters:
                self._vain[full] = self._vain.get(full, 0) + 1
            if self._answered is None:
                query.destroy()
            else:
                self._answered.append(query)
            del self._queries[full]

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
    come."""

    def __init__(self, node: Node, full: str) -> None:
        self.node = node
        self.lister = node.create_client(ListParameters, f"{full}/list_parameters")
        self.getter = node.create_client(GetParameters, f"{full}/get_parameters")
        self.polls = 0
        self.answer: dict[str, Any] | None = None
        self._names = None
        self._values = None

    def advance(self) -> None:
        """Takes the next step if it can be taken."""
        self.polls += 1
        if self._names is None:
            if self.lister.service_is_ready() and self.getter.service_is_ready():
                self._names = self.lister.call_async(ListParameters.Request())
        elif self._values is None:
            if self._names.done():
                names = self._names.result().result.names
                self._values = self.getter.call_async(GetParameters.Request(names=names))
        elif self._values.done():
            names = self._names.result().result.names
            values = map(parameter_value_to_python, self._values.result().values)
            self.answer = {name: _plain(value) for name, value in zip(names, values, strict=False)}

    def destroy(self) -> None:
        self.node.destroy_client(self.lister)
        self.node.destroy_client(self.getter)


def _plain(value: Any) -> Any:
    """The value as JSON can hold it."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return list(value)
