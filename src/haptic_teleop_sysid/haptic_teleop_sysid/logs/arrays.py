"""Named arrays, as MATLAB and NumPy keep them, as columns: what has as many rows belongs together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.logs.log import Column

#: Rows below which an array is a setting and no log; columns of a matrix beyond which it is a picture.
FEWEST_ROWS, MOST_COLUMNS = 10, 400
_DEEPEST = 12


def columns_of(content: Mapping[str, Any]) -> tuple[list[Column], list[str]]:
    """Return the columns of everything numeric in ``content`` (arrays, structs, cells and data frames, nested
    by dotted names), each in a group named by its number of rows, and remarks on what was passed over.

    A matrix is as long as its longer side; its columns are ``name[1]``, ``name[2]``, ...
    """
    found: list[tuple[str, NDArray[np.float64]]] = []
    passed: list[str] = []
    for name, value in content.items():
        for path, array in _leaves(name, value, _DEEPEST):
            _gathered(path, array, found, passed)
    counts = Counter(len(values) for _, values in found)
    columns = [Column(name, values, "", counted(len(values), "row")) for name, values in found]
    remarks = []
    if len(counts) > 1:
        told = ", ".join(
            f"{counted(count, 'column')} of {counted(rows, 'row')}" for rows, count in counts.most_common(5)
        )
        remarks.append(f"its arrays are of different lengths: {told}")
    if passed:
        shown = ", ".join(passed[:6]) + (f" and {len(passed) - 6} more" if len(passed) > 6 else "")
        remarks.append(f"passed over: {shown}")
    return columns, remarks


def _leaves(path: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    """(dotted name, array) of everything below a value: structs by field, cells and lists by number."""
    if depth == 0:
        return
    if isinstance(value, pd.DataFrame):
        index: Any = value.index
        if isinstance(index, (pd.TimedeltaIndex, pd.DatetimeIndex)):
            name = index.name or "time"
            since: Any = index - (index[0] if isinstance(index, pd.DatetimeIndex) else pd.Timedelta(0))
            yield f"{path}.{name} [s]", np.asarray(since.total_seconds())
        for name in value.columns:
            yield from _leaves(f"{path}.{name}", value[name].to_numpy(), depth - 1)
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _leaves(f"{path}.{name}", inner, depth - 1)
    elif isinstance(value, np.ndarray) and value.dtype.names:
        for index, one in enumerate(value.ravel(), start=1):
            own = path if value.size == 1 else f"{path}[{index}]"
            for name in value.dtype.names:
                yield from _leaves(f"{own}.{name}", one[name], depth - 1)
    elif isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.dtype == object):
        inner = list(value.ravel()) if isinstance(value, np.ndarray) else list(value)
        for index, one in enumerate(inner, start=1):
            yield from _leaves(path if len(inner) == 1 else f"{path}[{index}]", one, depth - 1)
    else:
        yield path, value


def _gathered(path: str, value: Any, found: list[tuple[str, NDArray[np.float64]]], passed: list[str]) -> None:
    array = np.asarray(value)
    if array.dtype.kind in "mM":  # durations and dates of NumPy
        start = array.ravel()[0] if array.dtype.kind == "M" and array.size else np.timedelta64(0, "ns")
        array = (array - start) / np.timedelta64(1, "s")
        path = f"{path} [s]"
    if array.dtype.kind not in "biuf" or array.ndim > 2:
        if array.size >= FEWEST_ROWS and array.dtype.kind not in "US":
            passed.append(f"{path} ({array.dtype}, {'x'.join(map(str, array.shape))})")
        return
    if array.ndim == 2:
        array = array.T if array.shape[0] < array.shape[1] else array
    else:
        array = array.reshape(-1, 1)
    if len(array) < FEWEST_ROWS:
        return
    if array.shape[1] > MOST_COLUMNS:
        passed.append(f"{path} ({'x'.join(map(str, array.shape))})")
        return
    for k in range(array.shape[1]):
        name = path if array.shape[1] == 1 else f"{path}[{k + 1}]"
        found.append((name, np.asarray(array[:, k], dtype=np.float64)))
