"""Is a text a table, whole or broken, or something that people wrote beside their recordings?"""

from __future__ import annotations

from pathlib import Path

from haptic_teleop_sysid.logs.dialect import COMMENTS, DELIMITERS, SAMPLE, cells, holds_number, is_number
from haptic_teleop_sysid.logs.headers import split_header

ENDINGS = (".txt", ".dat")
"""Endings that say nothing of what is in a file; others claim that it is a table."""
#: Rows of numbers at the end of a text by which it is a table that has only begun.
_BEGUN = 2


def is_prose(path: Path) -> bool:
    """Whether a file of ENDINGS is a text that is no recording, not even a broken one: its lines are not
    mostly rows of numbers, it does not end in such rows, and none is a header with units. What is empty or
    cannot be read is not called prose: a logger may have left it."""
    if path.suffix.lower() not in ENDINGS or not path.is_file():
        return False
    try:
        with path.open("rb") as stream:
            head = stream.read(SAMPLE)
    except OSError:
        return False
    if not head.strip() or b"\0" in head:
        return False
    lines = [line for line in head.decode("utf-8", "replace").splitlines() if line.strip()]
    if any(_is_header(line) for line in lines):
        return False
    rows = [_is_row(line) for line in lines if not line.lstrip().startswith(COMMENTS)]
    if not rows:
        return True
    # The last line may be cut short.
    begun = any(len(part) >= _BEGUN and all(part) for part in (rows[-_BEGUN:], rows[-_BEGUN - 1 : -1]))
    return not begun and 2 * sum(rows) < len(rows)


def _is_row(line: str) -> bool:
    """Whether a line is numbers, or half of its cells and at least two are, in any dialect."""
    for delimiter in DELIMITERS:
        found = cells(line, delimiter)
        for decimal in ".,":
            if decimal == delimiter:
                continue
            numbers = sum(holds_number(cell, decimal) for cell in found)
            if numbers and all(is_number(cell, decimal) for cell in found):
                return True
            if numbers >= 2 and 2 * numbers >= len(found):
                return True
    return False


def _is_header(line: str) -> bool:
    """Whether two or more cells state a unit."""
    text = line.lstrip("#%/ ")
    return any(
        sum(bool(split_header(cell)[1]) for cell in cells(text, delimiter)) >= 2
        for delimiter in DELIMITERS
        if delimiter != " "
    )
