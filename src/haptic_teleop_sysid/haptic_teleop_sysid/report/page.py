"""The page: an ordered collection of what a report says, rendered by one template with everything inside."""

from __future__ import annotations

import importlib.resources
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import jinja2
from markupsafe import Markup

from .live import as_script, available, live, packed_script
from .numbers import units_in
from .pictures import inline_svg, still
from .plot import Panel, Plot, Series
from .roles import ROLES, variables
from .samples import kept_words, pack_all
from .section import Link, Section, foldable, prose, unbreakable

Status = Literal["good", "fair", "bad", "plain"]
STATUS_WORD = {"good": "OK", "fair": "NOTE", "bad": "PROBLEM", "plain": "INFO"}
#: Samples of all lines of a page's still pictures together, and of one line at least and at most.
_STILL_POINTS, _LEAST_STILL, _MOST_STILL = 36_000, 300, 1500


@dataclass
class Page:
    """A report. Add the conclusion, verdicts, key figures and sections, then `write`."""

    title: str
    subtitle: str = ""
    conclusion: tuple[Status, str, str] | None = None
    command: str = ""
    verdicts: list[tuple[Status, str]] = field(default_factory=list)
    figures: list[tuple[str, str, str]] = field(default_factory=list)
    sections: list[Section] = field(default_factory=list)

    def conclude(self, status: Status, happened: str, todo: str = "", command: str = "") -> None:
        """State the page's first line: ``status`` says how good it is, ``happened`` what happened, ``todo``
        what to do, and ``command`` what to paste for that. Without it the first of the worst verdicts stands
        there."""
        self.conclusion, self.command = (status, happened, todo), command

    def verdict(self, status: Status, text: str) -> None:
        """Add a check: what is not good stands below the conclusion, what is good is folded away."""
        self.verdicts.append((status, text))

    def key_figure(self, value: str, label: str, note: str = "") -> None:
        """Add one large number to the summary, with what it is and what to hold it against."""
        self.figures.append((value, label, note))

    def section(self, title: str, text: str = "", folded: bool = False) -> Section:
        """Add and return a section."""
        section = Section(title, folded)
        self.sections.append(section)
        return section.text(text) if text else section

    def render(self) -> str:
        """Return the whole page as HTML."""
        environment = jinja2.Environment(
            autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
        )
        environment.tests["link"] = lambda cell: isinstance(cell, Link)
        environment.tests["unbreakable"] = unbreakable
        environment.filters["units"] = units_in
        environment.filters["foldable"] = foldable
        environment.filters["prose"] = prose
        environment.filters["identity"] = id
        files = importlib.resources.files("haptic_teleop_sysid.report")
        text = {
            name: files.joinpath(name).read_text(encoding="utf-8")
            for name in ("page.html.j2", "page.css", "samples.js", "cursor.js", "page.js")
        }
        conclusion, verdicts = self._concluded()
        drawn = _drawn(self.sections)
        return environment.from_string(text["page.html.j2"]).render(
            page=self,
            conclusion=conclusion,
            noted=[v for v in verdicts if v[0] in ("bad", "fair")],
            checks=[v for v in verdicts if v[0] in ("good", "plain")],
            drawn=drawn,
            status_word=STATUS_WORD,
            roles=ROLES,
            style=Markup(text["page.css"]),
            light=Markup(variables(dark=False)),
            dark=Markup(variables(dark=True)),
            script=Markup("".join(text[name] for name in text if name.endswith(".js"))),
            bokeh=Markup(packed_script()) if any("script" in d for d in drawn.values()) else "",
            written=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
        )

    def write(self, path: str | Path) -> Path:
        """Write the page to `path` and return it."""
        target = Path(path)
        target.write_text(self.render(), encoding="utf-8")
        return target

    def _concluded(self) -> tuple[tuple[Status, str, str] | None, list[tuple[Status, str]]]:
        """The first line, and the verdicts that it does not tell."""
        if self.conclusion is not None:
            return self.conclusion, [v for v in self.verdicts if v[1] not in self.conclusion[1]]
        if not self.verdicts:
            return None, []
        worst = min(self.verdicts, key=lambda v: ("bad", "fair", "good", "plain").index(v[0]))
        return (*worst, ""), [v for v in self.verdicts if v is not worst]


def _drawn(sections: Sequence[Section]) -> dict[int, dict[str, Any]]:
    """What the template draws of each plot and picture, by the identity of its block."""
    blocks = [(b, s.folded) for s in sections for b in s.blocks]
    fewer = _still_points(sum(b.plot.lines() for b, _ in blocks if b.plot is not None))
    plots = [(b.plot, folded) for b, folded in blocks if b.plot is not None and available()]
    listed = [(plot, panels, folded) for plot, folded in plots for panels in _views(plot).values()]
    found: dict[int, dict[str, Any]] = {}
    for number, (block, _) in enumerate(blocks):
        figure = block.figure if block.plot is None else still(block.plot, fewer)
        if figure is not None:
            name = f"picture{number}"
            found[id(block)] = {"svg": Markup(inline_svg(figure, name, block.text)), "name": name}
    if not listed:
        return found
    taken = len(packed_script()) + sum(len(one["svg"]) for one in found.values())
    packed = iter(pack_all(listed, taken))
    for block, _ in blocks:
        if block.plot is None:
            continue
        views, one = _views(block.plot), found[id(block)]
        samples = {view: next(packed) for view in views}
        content = {
            view: live(block.plot, panels, f"{one['name']}-{view}", samples[view])
            for view, panels in views.items()
        }
        one |= {"script": Markup(as_script(content)), "views": views, "legend": _legend(block.plot)}
        one |= {"kept": kept_words(samples["response"]), "ways": _ways(block.plot)}
    return found


def _still_points(lines: int) -> int:
    """Samples that each of so many lines of a page may have in a picture that stands still."""
    return max(_LEAST_STILL, min(_MOST_STILL, _STILL_POINTS // max(lines, 1)))


def _ways(plot: Plot) -> tuple[str, str]:
    """What it is to go left and right."""
    return ("Earlier", "Later") if plot.over_time else ("Left", "Right")


def _views(plot: Plot) -> dict[str, Sequence[Panel]]:
    """Panels that a plot shows at once, and on request."""
    found = {"response": plot.panels}
    return found | ({"difference": plot.difference} if plot.difference else {})


def _legend(plot: Plot) -> list[Series]:
    """The lines that the legend switches, where there are several."""
    found = plot.legend()
    return found if len(found) > 1 else []
