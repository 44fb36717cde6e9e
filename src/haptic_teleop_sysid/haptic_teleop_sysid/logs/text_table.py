"""Tables of text (CSV, TSV, cells apart by spaces), read by pandas; what pandas passes over is looked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.logs.dialect import COMMENTS, DELIMITERS, MISSING, Dialect, Stated, cells, dialect_of
from haptic_teleop_sysid.logs.log import MOST_ROWS, Column, Log

_LONGEST_LINE = 1 << 20
#: s, a day, and what is a date if it is more.
_DAY_S, _DATE_S = 86400.0, 3e8
#: Ragged rows that are named.
_TOLD = 3


@dataclass
class _Lines:
    """What was found line by line: ``rows`` in all, ``passed`` (line numbers, from 0, of comments and blank
    lines), ``ragged`` [(line, cells)], ``cut``: whether the last line is one that was not finished;
    ``again``: lines that repeat the header."""

    rows: int
    passed: list[int]
    ragged: list[tuple[int, int]]
    cut: int | None = None
    again: list[int] = field(default_factory=list)


def read_text(path: Path, stated: Stated | None, rows: tuple[int, int] | None, skip_ragged: bool) -> Log:
    """Return the table at ``path``; only ``rows`` (first, last), from 1, where given; rows of another number
    of cells are refused, or left out and told with ``skip_ragged``."""
    dialect = dialect_of(path, stated)
    if rows is None:
        estimate = path.stat().st_size / max(dialect.line_bytes, 1.0)
        if estimate > MOST_ROWS:
            raise RecordingError(
                f"{path} has about {estimate:.2g} rows ({path.stat().st_size / 1e9:.3g} GB), more than the "
                f"{MOST_ROWS} that are taken: take a part with `haptic-teleop import --rows FIRST LAST`."
            )
    start, stop = (0, MOST_ROWS) if rows is None else (rows[0] - 1, rows[1])
    found = _looked_through(path, dialect, start, stop)
    if found.rows == 0:
        raise RecordingError(f"{path} has no rows {start + 1} to {stop}: give other --rows.")
    remarks = [_read_as(dialect)]
    left_out = {*found.passed, *found.again}
    if found.cut is not None:
        left_out.add(found.cut)
        remarks.append(f"line {found.cut + 1}, the last, is cut short and was left out")
    if found.again:
        more = f" and {len(found.again) - 1} more" if len(found.again) > 1 else ""
        remarks.append(f"the header is there again in line {found.again[0] + 1}{more}, and was passed over")
    if found.ragged:
        told = ", ".join(f"line {line + 1} has {count}" for line, count in found.ragged[:_TOLD])
        if not skip_ragged:
            raise RecordingError(
                f"{path}: {counted(len(found.ragged), 'row has', 'rows have')} another number of cells "
                "than the "
                f"{len(dialect.names)} of the others ({told}): mend them, or leave them out with "
                "--skip-ragged."
            )
        left_out |= {line for line, _ in found.ragged}
        remarks.append(
            f"{counted(len(found.ragged), 'ragged row was', 'ragged rows were')} left out ({told})"
        )
    first = dialect.first + start
    frame = _parsed(path, dialect, first, found.rows, left_out)
    lines = np.setdiff1d(np.arange(first, first + found.rows), sorted(left_out)) + 1
    columns: list[Column] = []
    clocks: list[Column] = []
    for number in range(len(dialect.names)):
        header = dialect.names[number] or str(number + 1)
        values, bad, unit = _numbers(frame[number])
        text = None if bad is None else (int(lines[bad[0]]), bad[1])
        if not dialect.names[number] and text is None and not np.any(np.isfinite(values)):
            continue  # behind a delimiter that ends the rows
        columns.append(Column(header, values, unit or dialect.units[number], "", text))
        if unit and np.all(np.isfinite(values)):
            clocks.append(columns[-1])
    columns = _dated(columns, clocks, remarks)
    return Log(path, "CSV", tuple(columns), remarks=tuple(remarks), whole=found.cut is None)


def _dated(columns: list[Column], clocks: list[Column], remarks: list[str]) -> list[Column]:
    """The columns with the time of day counted from the date of the first row, where one column of each is
    among the ``clocks``: those that were written as dates or times of day."""
    dates = [c for c in clocks if c.values[0] > _DATE_S and np.all(c.values % _DAY_S == 0.0)]
    days = [c for c in clocks if c.values[0] < _DAY_S]
    if len(dates) != 1 or len(days) != 1:
        return columns
    remarks.append(f"{days[0].name!r} counts from the date in {dates[0].name!r}, taken for UTC")
    return [replace(c, values=c.values + dates[0].values[0]) if c is days[0] else c for c in columns]


def _read_as(dialect: Dialect) -> str:
    decimal = "comma" if dialect.decimal == "," else "point"
    header = "with a header" if any(dialect.names) else "without a header"
    passed = counted(dialect.passed_over, "line that was", "lines that were")
    before = f", behind {passed} passed over" if dialect.passed_over else ""
    return f"read as text, {DELIMITERS.get(dialect.delimiter, dialect.delimiter)} between cells, decimal " \
           f"{decimal}, {header}{before}"  # fmt: skip


def _looked_through(path: Path, dialect: Dialect, start: int, stop: int) -> _Lines:
    """Every line of the rows start to stop, counted without being kept."""
    width, named = len(dialect.names), any(dialect.names)
    found = _Lines(0, [], [])
    last = ""
    first = number = dialect.first + start
    for number, line in enumerate(_from(path, dialect, first, stop - start), first):
        found.rows += 1
        last = line
        if named and dialect.names[0] in line and tuple(dialect.cells(line)) == dialect.names:
            found.again.append(number)
        elif not line.strip() or line.lstrip().startswith(COMMENTS):
            found.passed.append(number)
        elif (count := _width(line, dialect)) != width:
            if count == width + 1 and not cells(line, dialect.delimiter)[-1]:
                continue  # a delimiter behind the last cell
            found.ragged.append((number, count))
    if found.ragged and found.ragged[-1][0] == number and not last.endswith("\n"):
        found.cut = found.ragged.pop()[0]
    return found


def _from(path: Path, dialect: Dialect, first: int, count: int) -> Iterator[str]:
    with path.open(encoding=dialect.encoding, errors="replace", newline="\n") as stream:
        for line in islice(stream, first, first + count):
            if len(line) > _LONGEST_LINE:
                raise RecordingError(f"{path} has a line of {len(line)} characters: it is no table.")
            yield line


def _width(line: str, dialect: Dialect) -> int:
    if dialect.delimiter == " ":
        return len(line.split())
    if '"' in line:
        return len(cells(line, dialect.delimiter))
    return line.count(dialect.delimiter) + 1


def _parsed(path: Path, dialect: Dialect, first: int, count: int, left_out: set[int]) -> Any:
    width = len(dialect.names)
    skipped = left_out | set(range(first)) if first < 1_000_000 else left_out
    reader: Any = pd.read_csv  # its types do not tell a column from a table
    try:
        return reader(
            path,
            sep=r"\s+" if dialect.delimiter == " " else dialect.delimiter,
            decimal=dialect.decimal,
            encoding=dialect.encoding,
            encoding_errors="replace",
            header=None,
            names=list(range(width)),
            usecols=list(range(width)),
            index_col=False,
            skiprows=sorted(skipped) if first < 1_000_000 else lambda i: i < first or i in left_out,
            nrows=count - len([i for i in left_out if i >= first]),
            na_values=sorted(MISSING),
            skipinitialspace=True,
            skip_blank_lines=True,
            low_memory=False,
        )
    except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError, OverflowError) as error:
        raise RecordingError(f"{path} cannot be read as a table ({error}): mend it.") from error


def _numbers(values: Any) -> tuple[NDArray[np.float64], tuple[int, str] | None, str]:
    """The numbers of a column, NaN where there is none; (row from 0, cell) of the first cell that is text;
    "s" for dates."""
    if pd.api.types.is_numeric_dtype(values) or pd.api.types.is_bool_dtype(values):
        return values.to_numpy(np.float64), None, ""
    numbers: Any = pd.to_numeric(values, errors="coerce")
    bad = np.flatnonzero((numbers.isna() & values.notna()).to_numpy())
    first = (int(bad[0]), str(values.iloc[int(bad[0])])) if len(bad) else None
    if first is not None and len(bad) == int(values.notna().sum()):
        instants = _instants(values)
        instants = _times_of_day(values) if instants is None else instants
        if instants is not None:
            return instants, None, "s"
    return numbers.to_numpy(np.float64), first, ""


def _times_of_day(values: Any) -> NDArray[np.float64] | None:
    """Seconds since the first midnight where all cells are times of day (14:03:07.125), else None."""
    texts = values.dropna().astype(str).str.strip()
    if not bool(texts.str.fullmatch(r"\d{1,2}:\d{2}:\d{2}([.,]\d+)?").all()):
        return None
    parts: Any = values.astype(str).str.strip().str.replace(",", ".", regex=False).str.split(":", expand=True)
    numbers = parts.apply(pd.to_numeric, errors="coerce").to_numpy(np.float64)
    seconds = numbers @ np.array([3600.0, 60.0, 1.0])
    return seconds + 86400.0 * np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -43200.0)


def _instants(values: Any) -> NDArray[np.float64] | None:
    """Seconds since 1970 where all cells are dates with times of ISO 8601, else None."""
    if not str(values.iloc[0])[:4].isdecimal():
        return None
    try:
        dates = pd.to_datetime(values, utc=True, format="ISO8601")
    except (ValueError, TypeError):
        return None
    since: Any = dates - pd.Timestamp(0, tz="UTC")
    return since.dt.total_seconds().to_numpy(np.float64)
