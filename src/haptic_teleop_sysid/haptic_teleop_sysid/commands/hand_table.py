"""A small table written by hand: CSV with a header line, or YAML with lists or rows; numbers only."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.named_files import why_unreadable
from haptic_teleop_control.strict_yaml import parse_yaml, yaml_problem

Array = NDArray[np.float64]


def read_table(path: str | Path, columns: tuple[str, ...], fewest: int = 2) -> dict[str, Array]:
    """Return the named columns, each (rows,). Lines that begin with # are remarks.

    Raises ConfigurationError naming file, line and remedy when a column is missing, a cell is no finite
    number, or there are fewer than `fewest` rows.
    """
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{path} cannot be read: {why_unreadable(path, error)}") from None
    rows = _yaml_rows(path, text) if Path(path).suffix in (".yaml", ".yml") else _csv_rows(text)
    needed = ", ".join(columns)
    found: dict[str, list[float]] = {name: [] for name in columns}
    for number, row in enumerate(rows, start=1):
        for name in columns:
            if name not in row:
                there = ", ".join(repr(n) for n in row) or "none"
                raise ConfigurationError(
                    f"{path}: row {number} has no column {name!r}: it needs {needed}, and has {there}; "
                    "rename the columns."
                )
            try:
                value = float(row[name])  # pyright: ignore[reportArgumentType]
            except (TypeError, ValueError):
                value = math.nan
            if not math.isfinite(value):
                raise ConfigurationError(
                    f"{path}: row {number}: {name} is {row[name]!r}: give a finite number."
                )
            found[name].append(value)
    if len(rows) < fewest:
        raise ConfigurationError(
            f"{path} has {len(rows)} rows, and at least {fewest} are needed, with the columns {needed}: "
            "measure more."
        )
    return {name: np.array(values) for name, values in found.items()}


def _csv_rows(text: str) -> list[dict[str, object]]:
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    reader = csv.DictReader(lines, skipinitialspace=True)
    return [{str(key).strip(): value for key, value in row.items()} for row in reader]


def _yaml_rows(path: str | Path, text: str) -> list[dict[str, object]]:
    try:
        content = parse_yaml(text)
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{path}: {yaml_problem(error)}") from None
    if isinstance(content, dict) and all(isinstance(v, list) for v in content.values()):
        lengths = {len(v) for v in content.values()}
        if len(lengths) == 1:
            names = list(content)
            return [dict(zip(names, row, strict=True)) for row in zip(*content.values(), strict=True)]
    if isinstance(content, list) and all(isinstance(row, dict) for row in content):
        return content
    raise ConfigurationError(f"{path}: give columns as lists of equal length, or a list of rows with names.")
