"""Changes a parameter of a running node."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.graph_client import GraphClient, graph_client, known

ANSWER = 10.0
"""s within which a node that is there answers."""


def change(node: str, name: str, value: Any, wait: float) -> int:
    """Has the node take the value, and prints what came of it. Returns 0, or 1 when the node refused.
    node: its full name, or one that only it has. A ConfigurationError when there is no such node within
    `wait` s, or it has no such parameter: printed, and SystemExit."""
    with graph_client("set") as client:
        done, message = _change(client, node, name, value, wait)
        print(message)
        client.status = 0 if done else 1
        return client.status


def _change(client: GraphClient, node: str, name: str, value: Any, wait: float) -> tuple[bool, str]:
    full = _found(client, node, wait)
    remote = AsyncParameterClient(client.node, full)
    if not client.until(remote.services_are_ready, wait):
        raise ConfigurationError(f"{full} offers no parameters: look whether it still starts.")
    before = _before(client, remote, full, name)
    (described,) = _answer(client, full, lambda: remote.describe_parameters([name])).descriptors
    if described.read_only:
        return (
            False,
            f"{full} refuses: {name} cannot change while the node runs; set it before the start.",
        )
    kind = Parameter.Type.from_parameter_value(value)
    if before.type_ == Parameter.Type.DOUBLE and kind == Parameter.Type.INTEGER:
        value = float(value)
    elif before.type_ == Parameter.Type.DOUBLE_ARRAY and kind == Parameter.Type.INTEGER_ARRAY:
        value = [float(v) for v in value]
    elif before.type_ != kind and before.type_ != Parameter.Type.NOT_SET:
        needs, got = (one.name.lower().replace("_", " ") for one in (before.type_, kind))
        return False, f"{full} refuses: {name} is a {needs} ({_text(before.value)}), not a {got}."
    answer = _answer(client, full, lambda: remote.set_parameters([Parameter(name, value=value)]))
    (result,) = answer.results
    if not result.successful:
        return False, f"{full} refuses: {result.reason}"
    return True, f"{full}: {name}: {_text(before.value)} -> {_text(value)}"


def _found(client: GraphClient, name: str, wait: float) -> str:
    def names() -> list[str]:
        there = client.node.get_node_names_and_namespaces()
        return [f"{space.rstrip('/')}/{node}" for node, space in there if node != client.node.get_name()]

    def fitting() -> set[str]:
        end = f"/{name.strip('/')}"
        return {full for full in names() if full == name or (not name.startswith("/") and full.endswith(end))}

    client.until(lambda: bool(fitting()), wait, name)
    found = fitting()
    if len(found) > 1:
        raise ConfigurationError(f"{name} may be {' or '.join(sorted(found))}: write the full name.")
    if not found:
        raise ConfigurationError(f"no node {name} is found within {wait:g} s; {known(names(), name)}")
    return found.pop()


def _before(client: GraphClient, remote: AsyncParameterClient, full: str, name: str) -> Parameter:
    """The parameter as it is now."""
    names = _answer(client, full, lambda: remote.list_parameters([], 0)).result.names
    if name not in names:
        raise ConfigurationError(f"{full} has no parameter {name}; {known(names, name)}")
    (value,) = _answer(client, full, lambda: remote.get_parameters([name])).values
    return Parameter.from_parameter_msg(_message(name, value))


def _message(name: str, value: Any) -> Any:
    message = Parameter(name).to_parameter_msg()
    message.value = value
    return message


def _answer(client: GraphClient, full: str, question: Callable[[], Any]) -> Any:
    answer = client.ask(question, time.monotonic() + ANSWER)
    if answer is None:
        raise ConfigurationError(f"{full} does not answer within {ANSWER:g} s: look whether it still runs.")
    return answer


def _text(value: Any) -> str:
    return str(list(value)) if hasattr(value, "tolist") or isinstance(value, (list, tuple)) else str(value)
