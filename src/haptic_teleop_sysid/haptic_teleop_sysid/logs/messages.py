"""The numbers within ROS messages, by dotted paths."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

#: Longest array that becomes columns, and most columns of one topic.
LONGEST, MOST_COLUMNS = 64, 400
_NAMES = ("name", "names", "joint_names")
_DEEPEST = 6
Getter = Callable[[Any], float]


def getters(message: Any) -> dict[str, Getter]:
    """Return what reads each number of messages like this one, by path.

    `position[elbow]` where the message names its joints (``name``, ``joint_names``), `wrench.torque.z`,
    `data[0]`. Times are left out: stamps are read by `stamp_of`.
    """
    labels = next((v for n in _NAMES if (v := _strings(getattr(message, n, None)))), ())
    found: dict[str, Getter] = {}
    for path, getter in _walk(message, "", labels, lambda m: m, _DEEPEST):
        if len(found) >= MOST_COLUMNS:
            break
        found[path] = getter
    return found


def stamp_of(message: Any) -> int:
    """``header.stamp`` in ns; 0 where the message has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None or not hasattr(stamp, "sec"):
        return 0
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def joints_of(message: Any) -> tuple[str, ...]:
    """The joints that a message names, in its order; () where it names none."""
    return next((v for n in _NAMES if (v := _strings(getattr(message, n, None)))), ())


def _walk(
    value: Any, path: str, labels: Sequence[str], get: Callable[[Any], Any], depth: int
) -> Iterator[tuple[str, Getter]]:
    if depth == 0 or isinstance(value, (str, bytes)):
        return
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        yield path, lambda m: float(get(m))
    elif isinstance(value, np.ndarray):
        if value.dtype.kind in "biuf" and value.size <= LONGEST:
            for i in range(value.size):
                yield f"{path}[{_label(labels, i, value.size)}]", _entry(get, i)
    elif isinstance(value, (list, tuple)):
        for i, inner in enumerate(value[:LONGEST]):
            name = f"{path}[{_label(labels, i, len(value))}]"
            yield from _walk(inner, name, labels, _item(get, i), depth - 1)
    elif hasattr(value, "__dataclass_fields__"):
        fields = [n for n in value.__dataclass_fields__ if not n.startswith("__")]
        if set(fields) <= {"sec", "nanosec"} or path == "header":
            return
        for name in fields:
            inner = getattr(value, name)
            yield from _walk(inner, f"{path}.{name}" if path else name, labels, _field(get, name), depth - 1)


def _entry(get: Callable[[Any], Any], i: int) -> Getter:
    def read(message: Any) -> float:
        values = get(message)
        return float(values[i]) if i < len(values) else np.nan

    return read


def _item(get: Callable[[Any], Any], i: int) -> Callable[[Any], Any]:
    return lambda message: get(message)[i]


def _field(get: Callable[[Any], Any], name: str) -> Callable[[Any], Any]:
    return lambda message: getattr(get(message), name)


def _label(labels: Sequence[str], i: int, size: int) -> str:
    return labels[i] if len(labels) == size else str(i)


def _strings(value: Any) -> tuple[str, ...]:
    if isinstance(value, (list, tuple)) and value and all(isinstance(v, str) for v in value):
        return tuple(value) if len(set(value)) == len(value) else ()
    return ()
