"""Parameters that a recording carries about itself: `haptic_teleop.parameters`, node name -> {parameter:
value}.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any


def flattened(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, value) of nested or dotted parameters; `ros__parameters` levels vanish."""
    for key, value in values.items():
        name = prefix if key == "ros__parameters" else (f"{prefix}.{key}" if prefix else str(key))
        if isinstance(value, Mapping):
            yield from flattened(value, name)
        else:
            yield name, value


def recorded_value(
    parameters: Mapping[str, Any], keys: Sequence[str], nodes: Sequence[str] = ()
) -> tuple[float, str] | None:
    """Return (value, "node: key") of the first of `keys` that a node states as a finite number, or None.

    Nodes whose last name is in `nodes` are asked first, in that order, then the others as recorded.
    """
    for value, where in _stated(parameters, keys, nodes):
        if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
            return float(value), where
    return None


def first_stated(
    parameters: Mapping[str, Any], keys: Sequence[str], nodes: Sequence[str] = ()
) -> tuple[Any, str] | None:
    """Return (value, "node: key") of the first of `keys` that a node states, whatever it is, or None; nodes
    are asked as by `recorded_value`."""
    return next(_stated(parameters, keys, nodes), None)


def recorded_units(experiment: Mapping[str, Any], joint: str) -> dict[str, str]:
    """Return the units of a joint's "position" and "input": those that an imported recording states, else
    rad and N*m."""
    found = {"position": "rad", "input": "N*m"}
    story = experiment.get("import")
    units = story.get("units") if isinstance(story, Mapping) else None
    own = units.get(joint) if isinstance(units, Mapping) else None
    if isinstance(own, Mapping):
        found |= {name: str(own[name]) for name in found if isinstance(own.get(name), str)}
    return found


def recorded_text(parameters: Mapping[str, Any], key: str, nodes: Sequence[str] = ()) -> str | None:
    """Return the text that a node states for `key`, or None; nodes are asked as by `recorded_value`."""
    for value, _ in _stated(parameters, (key,), nodes):
        if isinstance(value, str):
            return value
    return None


def _stated(
    parameters: Mapping[str, Any], keys: Sequence[str], nodes: Sequence[str]
) -> Iterator[tuple[Any, str]]:
    by_name = [
        (str(node).rstrip("/").rsplit("/", 1)[-1], str(node), content) for node, content in parameters.items()
    ]
    order = {name: index for index, name in enumerate(nodes)}
    by_name.sort(key=lambda entry: order.get(entry[0], len(order)))
    for _, node, content in by_name:
        flat = dict(flattened(content)) if isinstance(content, Mapping) else {}
        for key in keys:
            if key in flat:
                yield flat[key], f"{node}: {key}"
