"""Tables on a terminal that stay whole however narrow it is and however long the names in them are."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from rich.cells import cell_len, chop_cells
from rich.console import Console, ConsoleOptions, RenderResult
from rich.table import Table
from rich.text import Text

#: A name is broken behind one of these before it is broken anywhere else.
_PIECE = re.compile(r"[^\s_./]*[\s_./]?")
#: What a column takes beside its text: its own line and a blank on either side.
_FRAME = 3


@dataclass(frozen=True)
class TerminalTable:
    """``rows`` of cells under the headings ``header``; a line break in a cell is kept. Columns whose heading
    is in ``right`` hold numbers, which are never broken; all else is wrapped within its column, so that two
    long names that differ at one end only are still told apart."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    right: Collection[str] = ()
    title: str = ""

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The title, and the table in the width that there is."""
        if self.title:
            yield Text(wrapped(self.title, options.max_width), style="italic")
        widths = self.widths(options.max_width)
        rows = [
            [wrapped(cell, width) for cell, width in zip(row, widths, strict=True)]
            for row in (self.header, *self.rows)
        ]
        tall = any("\n" in cell for row in rows[1:] for cell in row)
        table = Table(show_lines=tall)
        for name, heading, width in zip(self.header, rows[0], widths, strict=True):
            justify = "right" if name in self.right else "left"
            table.add_column(Text(heading), justify=justify, width=width, no_wrap=True)
        for row in rows[1:]:
            table.add_row(*map(Text, row))  # brackets in a name are no markup
        yield table

    def widths(self, available: int) -> list[int]:
        """Widths of the columns (n) that together fit into ``available``, as far as numbers stay whole: the
        widest give way first."""
        columns = list(zip(self.header, *self.rows, strict=True))
        widths = [max(cell_len(line) for cell in column for line in cell.split("\n")) for column in columns]
        room = available - _FRAME * len(columns) - 1
        for whole in (12, 10, 8, 4, 1):  # parts of names up to this long stay whole, as long as there is room
            least = [self._least(column, whole) for column in columns]
            while sum(widths) > room and (wide := [i for i, w in enumerate(widths) if w > least[i]]):
                widths[max(wide, key=widths.__getitem__)] -= 1
        return widths

    def _least(self, column: Sequence[str], whole: int) -> int:
        """The width in which numbers, and parts of names up to ``whole``, are not broken."""
        heading, *cells = column
        parts = [cell_len(p.rstrip()) for text in column for p in _PIECE.findall(text)]
        least = min(whole, max(parts, default=1))
        return max([least, 1, *map(cell_len, cells)]) if heading in self.right else max(least, 1)


def wrapped(text: str, width: int) -> str:
    """The text in lines of at most ``width`` columns, broken behind blanks, ``_``, ``.`` and ``/`` first."""
    return "\n".join(line for given in text.split("\n") for line in _lines(given, width))


def _lines(text: str, width: int) -> Iterator[str]:
    if cell_len(text) <= width:
        yield text
        return
    line = ""
    for piece in filter(None, _PIECE.findall(text)):
        if line and cell_len((line + piece).rstrip()) > width:
            if len(line) > 1:
                yield line.rstrip()
            else:  # the mark behind a part that filled a line is no line of its own
                piece = line + piece
            line = ""
        *full, rest = chop_cells(piece, width) if cell_len(piece.rstrip()) > width else [piece]
        yield from full
        line += rest
    if line.strip():
        yield line.rstrip()
