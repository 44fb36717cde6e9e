"""Parameters that a recording carries about itself: `haptic_teleop.parameters`, node name -> {parameter: value}."""

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
    by_name = [(str(node).rstrip("/").rsplit("/", 1)[-1], str(node), content) for node, content in parameters.items()]
    order = {name: index for index, name in enumerate(nodes)}
    by_name.sort(key=lambda entry: order.get(entry[0], len(order)))
    for _, node, content in by_name:
        if not isinstance(content, Mapping):
            continue
        flat = dict(flattened(content))
        for key in keys:
            value = flat.get(key)
            if isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value):
                return float(value), f"{node}: {key}"
    return None
