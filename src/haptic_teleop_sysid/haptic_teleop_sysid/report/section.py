"""What a page is made of: sections, and in them texts, tables, plots, pictures and commands."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal
from urllib.parse import quote

from markupsafe import Markup, escape

from .plot import Plot

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.figure import Figure

#: Cells that say that there is nothing, and how a date begins.
_NOTHING, _DATE = ("", "–", "—"), re.compile(r"\d{4}-\d\d-\d\d")
#: How a number begins, and no name such as 037_week.
_NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)(e[+-]?\d+)?(?![\w.])|(nan|inf)$")
#: Where a name may be broken.
_FOLDS = re.compile(r"(_|(?<=[\w/])[./](?=[A-Za-z]{2}))")
#: As much of a sentence: what is shorter goes to the next line as a whole.
_WIDE_IN_PROSE = 24
#: What stays on one line: of a cell a number with its percent or exponent, or a range; a date with its time,
#: the name of an option.
_EXPONENT = r"(?:e[+-]?\d+)?"
_RANGE = re.compile(
    r"(?<![\w.])((?:[≤≥] )?(?:\d[\d.]*–)?\d[\d.]* %|\d[\d.]*–\d[\d.]*(?: s\b)?(?!\w)|"
    rf"[−-]?\d[\d.]*{_EXPONENT} … [−-]?\d[\d.]*{_EXPONENT}|[−-]?\d[\d.]*e[+-]?\d+(?!\w))"
)
_WHOLE = re.compile(r"(?<![\w/.-])(\d{4}-\d\d-\d\d(?: \d\d:\d\d)?|--[a-z][\w-]*)(?![\w-])")
_ONE_LINE = r'<span class="whole">\1</span>'
#: What is meant to be typed.
_CODE = re.compile(r"`([^`]+)`")
#: Characters without a space from which a word may be broken anywhere: no column has room for it.
_LONG_WORD = 22
#: Characters of a name from which a narrow column may break it where its parts meet.
_WIDE_WORD = 14


class Link(str):
    """A cell that leads to another file: its text, and ``href``, a path relative to the page."""

    href: str

    def __new__(cls, text: str, path: str) -> Link:
        link = super().__new__(cls, text)
        link.href = quote(path)
        return link


@dataclass(frozen=True)
class Block:
    """One piece of a section; `kind` selects how the template draws it."""

    kind: Literal["text", "table", "picture", "plot", "commands"]
    text: str = ""
    header: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    figure: Figure | None = None
    plot: Plot | None = None

    def numeric(self) -> list[bool]:
        """Which columns of a table are set right-aligned: those most of whose cells are numbers."""
        columns = zip(*(row for row in self.rows if len(row) == len(self.header)), strict=True)
        told = [[cell for cell in column if cell not in _NOTHING] for column in columns]
        found = [2 * sum(map(looks_numeric, cells)) >= max(len(cells), 1) for cells in told]
        return found or [False] * len(self.header)

    def heads(self) -> int:
        """The column whose cells say what their rows are about: the first one, or the name beside a number
        such as a rank."""
        return 1 if self.numeric()[:2] == [True, False] else 0


@dataclass
class Section:
    """A heading with texts, tables, plots and pictures in the order in which they were added; a ``folded``
    one shows its heading until it is opened."""

    title: str
    folded: bool = False
    blocks: list[Block] = field(default_factory=list)

    def text(self, text: str) -> Section:
        """Add a paragraph; it is escaped."""
        self.blocks.append(Block("text", text=text))
        return self

    def table(self, header: Sequence[str], rows: Sequence[Sequence[object]], caption: str = "") -> Section:
        """Add a table; cells are written with `str` (a `Link` leads elsewhere) and escaped, those that are
        numbers are set right-aligned.
        """
        cells = tuple(tuple(c if isinstance(c, Link) else str(c) for c in row) for row in rows)
        self.blocks.append(Block("table", text=caption, header=tuple(header), rows=cells))
        return self

    def plot(self, plot: Plot, caption: str = "") -> Section:
        """Add lines on which one zooms and pans; `caption` is also what a screen reader says."""
        self.blocks.append(Block("plot", text=caption, plot=plot))
        return self

    def picture(self, figure: Figure, caption: str = "") -> Section:
        """Add a matplotlib figure as inline SVG; `caption` is also what a screen reader says."""
        self.blocks.append(Block("picture", text=caption, figure=figure))
        return self

    def commands(self, steps: Sequence[tuple[str, str]]) -> Section:
        """Add numbered steps, each with what it is for and a command to paste."""
        self.blocks.append(Block("commands", rows=tuple(steps)))
        return self


def looks_numeric(cell: str) -> bool:
    """True for a cell that begins like a number and is no date."""
    text = cell.strip().lstrip("+-−±<>≤≥≈( ")
    return _NUMBER.match(text) is not None and not _DATE.match(text)


def unbreakable(cell: str) -> bool:
    """Whether a cell holds a word too long for a column of a sheet of paper: it alone is broken."""
    return max(map(len, cell.split()), default=0) >= _LONG_WORD


def foldable(cell: str) -> Markup:
    """The cell as HTML in which a narrow column may break long names: behind underscores, dots and
    slashes."""
    return Markup(_RANGE.sub(_ONE_LINE, _folded(cell, _WIDE_WORD)))


def prose(text: str) -> Markup:
    """A sentence as HTML: what stands between backticks is code."""
    return Markup(_CODE.sub(r"<code>\1</code>", _folded(text, _WIDE_IN_PROSE)))


def _folded(text: str, wide: int) -> str:
    html = re.sub(rf"\S{{{wide},}}", lambda word: _FOLDS.sub(r"\1<wbr>", word[0]), str(escape(text)))
    return _WHOLE.sub(_ONE_LINE, html)
