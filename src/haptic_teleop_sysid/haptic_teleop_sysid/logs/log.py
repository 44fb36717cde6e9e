"""A log in memory: named columns of numbers, as its file has them."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sysid.logs.headers import split_header

MOST_ROWS = 5_000_000
"""Rows of a log beyond which it is refused unread: its arrays would not fit beside each other."""
MOST_BYTES = 2 << 30
"""Bytes of arrays in a file beyond which it is refused unread."""


@dataclass(frozen=True)
class Column:
    """One column: ``name`` as in the file (a number where there is no header), ``values`` (n,) float64 with
    NaN where nothing is there, ``unit`` as the file states it or "", ``group``: columns of one group share
    their rows (in a bag, the topic). ``text``: (line of the file, cell) of the first cell that is text, else
    None. ``usual``: the unit by convention (REP 103), which a mapping may contradict. ``told``: what was done
    to its values, in a sentence."""

    name: str
    values: NDArray[np.float64]
    unit: str = ""
    group: str = ""
    text: tuple[int, str] | None = None
    usual: str = ""
    told: str = ""

    @property
    def recorded(self) -> bool:
        """Whether it is a field of a topic: `/states:position[m]` is of a joint m, not in metres."""
        return self.group.startswith("/")

    @property
    def label(self) -> str:
        """The name without the unit."""
        return self.name if self.recorded else split_header(self.name)[0]

    @property
    def stated(self) -> str:
        """The unit that the file states, in a place of its own or in the name; "" for none."""
        return self.unit or ("" if self.recorded else split_header(self.name)[1])

    @property
    def holds_text(self) -> str:
        """Which cell is text, and what to do; "" for none."""
        if self.text is None:
            return ""
        line, cell = self.text
        grouped = re.fullmatch(r"[+-]?\d{1,3}([,.' ]\d{3})+([.,]\d+)?", cell.strip()) is not None
        remedy = "take out what parts its thousands" if grouped else "mend it"
        return f"{self.name!r} holds text, first {cell[:40]!r} in line {line}: {remedy}"

    @property
    def unusable(self) -> str:
        """Why no signal can be made of it, in a few words; "" where one can."""
        if self.text is not None:
            return f"{self.name!r} holds text"
        return "" if np.any(np.isfinite(self.values)) else f"{self.name!r} holds no number"

    @property
    def known(self) -> str:
        """The unit that the file states, else the usual one."""
        return self.stated or self.usual


@dataclass(frozen=True)
class Log:
    """What a file holds: ``kind`` ("CSV", ...), ``columns``; ``stamps`` and ``received``: (n,) int64 ns by
    group where the file itself tells when its rows are from; ``remarks``: how it was read and what of it was
    passed over, in sentences; ``whole``: whether it ends where it was meant to."""

    path: Path
    kind: str
    columns: tuple[Column, ...]
    stamps: dict[str, NDArray[np.int64]] = field(default_factory=dict)
    received: dict[str, NDArray[np.int64]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    whole: bool = True

    def find(self, name: str | int) -> Column:
        """Return the column of a name (with or without its unit) or of a number, from 1.

        Raises ConfigurationError, with what comes near, when there is none or more than one.
        """
        if isinstance(name, int):
            if not 1 <= name <= len(self.columns):
                raise ConfigurationError(
                    f"{self.path} has columns 1 to {len(self.columns)}, not {name}: correct the mapping."
                )
            return self.columns[name - 1]
        for pick in (lambda c: c.name, lambda c: c.label):
            found = [c for c in self.columns if pick(c) == name]
            if len(found) == 1:
                return found[0]
            if found:
                raise ConfigurationError(
                    f"{self.path} has {len(found)} columns {name!r}: name one by its number, from 1."
                )
        near = difflib.get_close_matches(name, [c.name for c in self.columns], 3, 0.4)
        raise ConfigurationError(
            f"{self.path} has no column {name!r}: correct the mapping"
            + (f"; near are {', '.join(map(repr, near))}" if near else "")
            + f" (it has {named(self.columns)})."
        )

    def number(self, column: Column) -> int:
        """The place of a column, from 1."""
        return next(i for i, c in enumerate(self.columns, start=1) if c is column)


def named(columns: tuple[Column, ...], most: int = 12) -> str:
    """The names of columns in a line."""
    shown = ", ".join(repr(c.name) for c in columns[:most]) or "no column of numbers"
    return shown + (f" and {len(columns) - most} more" if len(columns) > most else "")


def refuse_rows(path: Path, rows: float, remedy: str) -> None:
    """Raise RecordingError for more than MOST_ROWS rows."""
    if rows > MOST_ROWS:
        raise RecordingError(
            f"{path} has about {rows:.3g} rows, more than the {MOST_ROWS} that are taken: {remedy}."
        )


def refuse_bytes(path: Path, size: float, remedy: str) -> None:
    """Raise RecordingError for arrays of more than MOST_BYTES."""
    if size > MOST_BYTES:
        raise RecordingError(
            f"{path} would fill {size / 1e9:.3g} GB of memory, more than the {MOST_BYTES / 1e9:.2g} GB that "
            f"are taken: {remedy}."
        )
