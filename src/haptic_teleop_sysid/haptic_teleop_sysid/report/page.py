"""The page: an ordered collection of what a report says, rendered by one template with everything inside."""

from __future__ import annotations

import importlib.resources
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Literal
from urllib.parse import quote

import jinja2
from markupsafe import Markup
from matplotlib.figure import Figure

from haptic_teleop_sysid.report.pictures import inline_svg

Status = Literal["good", "fair", "bad", "plain"]
STATUS_WORD = {"good": "OK", "fair": "NOTE", "bad": "PROBLEM", "plain": "INFO"}


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

    kind: Literal["text", "table", "picture"]
    text: str = ""
    svg: str = ""
    header: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()


@dataclass
class Section:
    """A heading with texts, tables and pictures in the order in which they were added."""

    title: str
    page: Page
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

    def picture(self, figure: Figure, caption: str = "") -> Section:
        """Add a matplotlib figure as inline SVG; `caption` is also what a screen reader says."""
        self.page.picture_count += 1
        svg = inline_svg(figure, prefix=f"picture{self.page.picture_count}", description=caption)
        self.blocks.append(Block("picture", text=caption, svg=svg))
        return self


@dataclass
class Page:
    """A report. Add verdicts, key figures and sections, then `write`."""

    title: str
    subtitle: str = ""
    verdicts: list[tuple[Status, str]] = field(default_factory=list)
    figures: list[tuple[str, str, str]] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)
    picture_count: int = 0

    def verdict(self, status: Status, text: str) -> None:
        """Add a line to the summary at the top; `status` says how good the news is."""
        self.verdicts.append((status, text))

    def key_figure(self, value: str, label: str, note: str = "") -> None:
        """Add one large number to the summary, with what it is and what to hold it against."""
        self.figures.append((value, label, note))

    def section(self, title: str, text: str = "") -> Section:
        """Add and return a section."""
        section = Section(title, self)
        self.sections.append(section)
        return section.text(text) if text else section

    def render(self) -> str:
        """Return the whole page as HTML."""
        environment = jinja2.Environment(
            autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
        )
        environment.tests["numeric"] = looks_numeric
        environment.tests["link"] = lambda cell: isinstance(cell, Link)
        files = importlib.resources.files("haptic_teleop_sysid.report")
        template = environment.from_string(files.joinpath("page.html.j2").read_text(encoding="utf-8"))
        style = files.joinpath("page.css").read_text(encoding="utf-8")
        return template.render(
            page=self,
            status_word=STATUS_WORD,
            style=Markup(style),
            written=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        )

    def write(self, path: str | Path) -> Path:
        """Write the page to `path` and return it."""
        target = Path(path)
        target.write_text(self.render(), encoding="utf-8")
        return target


def looks_numeric(cell: str) -> bool:
    """True for a cell that begins like a number (or says that there is none), which the table sets
    right-aligned.
    """
    text = cell.strip().lstrip("+-−±<>≈ ")
    return text[:1].isdigit() or text in {"–", "—", "nan", "inf"}
