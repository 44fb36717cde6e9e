"""How a table of text is written: encoding, delimiter, decimal mark, where its header ends."""

from __future__ import annotations

import csv
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.logs.units import unit_of

SAMPLE = 1 << 18
"""Bytes from which the dialect is drawn."""
COMMENTS = ("#", "%", "//")
MISSING = frozenset({"", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "-inf", "+inf"})
"""Cells, in lower case, that say that nothing is there."""
DELIMITERS = {";": "semicolon", "\t": "tab", ",": "comma", "|": "bar", " ": "space"}
_NUMBER = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?$"),
}


@dataclass(frozen=True)
class Dialect:
    """``delimiter``, " " for any space; ``decimal`` "." or ","; ``names`` of the columns ("" each where there
    is no header), ``units`` from a row of their own ("" where there is none); ``first``: line of the first
    row, from 0; ``line_bytes``: mean length of a row; ``passed_over``: lines before the header."""

    encoding: str
    delimiter: str
    decimal: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    first: int
    line_bytes: float
    passed_over: int

    def cells(self, line: str) -> list[str]:
        """The cells of a line."""
        return cells(line, self.delimiter)


@dataclass(frozen=True)
class Stated:
    """What a mapping's `read` section says of the dialect; None: to be found."""

    delimiter: str | None = None
    decimal: str | None = None
    header: bool | None = None
    skip: int = 0


def cells(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without space or quotes around them; what is in quotes is one cell."""
    text = line.rstrip("\r\n")
    if delimiter == " ":
        parts = text.split()
    elif '"' in text:
        parts = next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))
    else:
        parts = text.split(delimiter)
    return [p.strip().strip('"').strip() for p in parts]


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, or says that there is none."""
    return cell.lower() in MISSING or bool(_NUMBER[decimal].match(cell))


def holds_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number."""
    return bool(_NUMBER[decimal].match(cell))


def dialect_of(path: Path, stated: Stated | None = None) -> Dialect:
    """Return how the table at ``path`` is written. Raises RecordingError where it is no table of numbers."""
    stated = stated or Stated()
    with path.open("rb") as stream:
        head = stream.read(SAMPLE)
    encoding = _encoding(path, head)
    lines = head.decode(encoding, "replace").splitlines()
    if len(head) == SAMPLE:
        lines = lines[:-1]
    body = [(i, line) for i, line in enumerate(lines) if i >= stated.skip and line.strip()]
    rows = [(i, line) for i, line in body if not line.lstrip().startswith(COMMENTS)]
    choices = [
        (delimiter, decimal)
        for delimiter in ([stated.delimiter] if stated.delimiter else DELIMITERS)
        for decimal in ([stated.decimal] if stated.decimal else ".,")
        if delimiter != decimal
    ]
    scored = [(_score([line for _, line in rows[-200:]], *choice), choice) for choice in choices]
    # The first of equals: a semicolon before a comma, a decimal point before a decimal comma.
    (numbers, _, columns), (delimiter, decimal) = max(scored, key=lambda s: s[0])
    if not numbers:
        raise RecordingError(
            f"{path}: no row of it holds numbers: export the log as CSV with a header and one row a sample."
        )
    _refuse_both_marks(path, rows, delimiter, decimal, columns)
    first = _first_row(rows, delimiter, decimal, columns)
    names, units, used = _header(body, rows, first, delimiter, decimal, columns, stated.header)
    sizes = [len(line) + 1 for i, line in rows[first:]]
    return Dialect(
        encoding,
        delimiter,
        decimal,
        names,
        units,
        rows[first][0],
        sum(sizes) / len(sizes),
        rows[first][0] - used,
    )


def _encoding(path: Path, head: bytes) -> str:
    if not head.strip():
        raise RecordingError(f"{path} is empty: name another log.")
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if b"\0" in head or sum(byte < 9 or 13 < byte < 32 for byte in head) > 0.02 * len(head):
        raise RecordingError(
            f"{path} is neither a table of text nor of a binary kind that is known (MATLAB, NumPy, Parquet, "
            "ROS bag); it may be encrypted or packed: decrypt or unpack it, or export it as CSV."
        )
    try:
        head[: head.rfind(b"\n") + 1].decode("utf-8-sig")
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


def _score(lines: list[str], delimiter: str, decimal: str) -> tuple[int, float, int]:
    """(cells that are numbers in rows of the usual width, their share there, that width)."""
    split = [cells(line, delimiter) for line in lines]
    if not split:
        return 0, 0.0, 0
    width = Counter(map(len, split)).most_common(1)[0][0]
    usual = [row for row in split if len(row) == width]
    numbers = sum(bool(_NUMBER[decimal].match(c)) for row in usual for c in row)
    return numbers, numbers / max(width * len(usual), 1), width


def _refuse_both_marks(
    path: Path, rows: list[tuple[int, str]], delimiter: str, decimal: str, columns: int
) -> None:
    other = "," if decimal == "." else "."
    for i, line in rows:
        found = cells(line, delimiter)
        if len(found) != columns or all(is_number(c, decimal) for c in found):
            continue
        if delimiter != other and all(is_number(c, other) for c in found):
            raise RecordingError(
                f"{path} has decimal points and decimal commas (line {i + 1} is unlike others): make them "
                "one, or, if one of the two parts thousands, take it out."
            )


def _first_row(rows: list[tuple[int, str]], delimiter: str, decimal: str, columns: int) -> int:
    for k, (_, line) in enumerate(rows):
        found = cells(line, delimiter)
        if len(found) == columns and any(_NUMBER[decimal].match(c) for c in found):
            numbers = sum(is_number(c, decimal) for c in found)
            if 2 * numbers >= len(found) or k + 1 == len(rows):
                return k
    return len(rows) - 1


def _header(
    body: list[tuple[int, str]],
    rows: list[tuple[int, str]],
    first: int,
    delimiter: str,
    decimal: str,
    columns: int,
    wanted: bool | None,
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Names, units, and how many lines before the first row they take up."""
    none = ("",) * columns
    if wanted is False:
        return none, none, 0
    above = [cells(line, delimiter) for _, line in rows[:first]]
    above = [row[:-1] if len(row) == columns + 1 and not row[-1] else row for row in above]
    commented = [
        cells(line.lstrip().lstrip("#%/").strip(), delimiter)
        for i, line in body
        if i < rows[first][0] and line.lstrip().startswith(COMMENTS)
    ]
    # Rows may end with a delimiter where the header does not.
    open_ended = all(not cells(line, delimiter)[-1] for _, line in rows[first : first + 20])
    fitting = [row if len(row) == columns else [*row, ""] for row in above or commented
               if len(row) == columns or (open_ended and len(row) == columns - 1)]  # fmt: skip
    fitting = [row for row in fitting if not any(_NUMBER[decimal].match(c) for c in row)]
    if not fitting:
        return none, none, 0
    last = [c.strip("[]() ") for c in fitting[-1]]
    if len(fitting) > 1 and all(not c or c == "-" or unit_of(c) for c in last):
        units = tuple(c if unit_of(c) else "" for c in last)
        return tuple(fitting[-2]), units, 2
    return tuple(fitting[-1]), none, 1
