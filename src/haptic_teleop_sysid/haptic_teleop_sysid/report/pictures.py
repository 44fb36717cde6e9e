"""Pictures that stand still: matplotlib, for paper, for PNG files and for pages whose scripts are off.

Lines are drawn in the colours of their roles; for the page each colour becomes a CSS variable, so that one
picture is legible on white, in the dark and on paper.  Long series are thinned to the extremes of each bin:
nothing that can be seen is lost and the page stays small.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from .plot import Panel, Plot, Series, log_ticks, thinned
from .roles import ROLES, variable

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

INK, GRID, SHADE, BAND = "#1c2431", "#dfe3ea", "#e9edf4", "#cfdcef"
COLOUR = {name: role.light for name, role in ROLES.items()}
CSS_VARIABLE = {INK: "--ink", GRID: "--grid", SHADE: "--shade", BAND: "--band"} | {
    colour: variable(name) for name, colour in COLOUR.items()
}
#: Samples of a line that a picture of this size can show.
POINTS = 1500
STYLE: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": GRID,
    "grid.linewidth": 0.7,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "haptic-teleop",
}
#: Where the axes of a plot that was drawn before lie: page and file draw it with other numbers of samples,
#: and finding the places takes as long as drawing.
_PLACES: WeakKeyDictionary[Plot, list[Bbox]] = WeakKeyDictionary()


@contextmanager
def styled(style: Any = STYLE) -> Iterator[None]:
    """Within it matplotlib draws in this style."""
    from matplotlib import rc_context

    with rc_context(style):
        yield


def blank(width: float, height: float) -> Figure:
    """Return an empty figure, in inches, that lays itself out."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def still(plot: Plot, points: int = POINTS) -> Figure:
    """Return the panels one below the other, laid out, each line of at most about ``points`` samples."""
    own = any(p.x_label for p in plot.panels)
    with styled():
        figure = blank(10.0, 1.75 * len(plot.panels) + 0.5)
        axes = figure.subplots(len(plot.panels), 1, sharex=not own, squeeze=False)[:, 0]
        for axis, panel in zip(axes, plot.panels, strict=True):
            _draw(axis, panel, points, plot.dated)
            if panel.x_label:
                axis.set_xlabel(panel.x_label)
        if not own:
            axes[-1].set_xlabel(plot.x_label)
        if plot.named_ticks:
            axes[-1].set_xticks(range(1, len(plot.names) + 1), plot.names, rotation=30, ha="right")
        figure.align_ylabels(list(axes))
        if plot in _PLACES:
            for axis, place in zip(axes, _PLACES[plot], strict=True):
                axis.set_position(place)
            figure.set_layout_engine(None)
        else:
            _lay_out(figure)
            _PLACES[plot] = [axis.get_position(original=True).frozen() for axis in axes]
    return figure


def _draw(axis: Axes, panel: Panel, points: int, dated: bool = False) -> None:
    def when(time: Any) -> Any:
        # matplotlib counts days.
        return np.asarray(time) / 86400.0 if dated else time

    if dated:
        axis.xaxis_date()
    for start, end in panel.spans:
        axis.axvspan(when(start), when(end), color=SHADE, linewidth=0, zorder=0)
    if panel.band is not None:
        band = panel.band
        axis.fill_between(
            when(band.time), band.low, band.high, color=BAND, linewidth=0, zorder=0.5, label=band.label
        )
    for level in panel.guides:
        axis.axhline(level, color=INK, linewidth=0.7, linestyle=(0, (2, 3)), zorder=1)
    for moment in panel.moments:
        axis.axvline(when(moment), color=COLOUR["fourth"], linewidth=0.8, zorder=1)
    for line in panel.series:
        _line(axis, replace(line, time=when(line.time)), points)
    if panel.logarithmic:
        axis.set_yscale("log")
        axis.set_yticks(log_ticks(*panel.limits()))
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter("")
    axis.set_title(f"{panel.title}{': ' if panel.note else ''}{panel.note}")
    axis.set_ylabel(panel.unit)
    axis.set_ylim(*panel.limits())
    # Marks at either end stand clear of the axis.
    axis.margins(x=0.02 if any(line.marks for line in panel.series) else 0.005)
    if sum(bool(line.label) for line in panel.series) > 1:
        handles, labels = axis.get_legend_handles_labels()
        once = dict(zip(labels, handles, strict=True))  # of both ends of a limit, one
        place = {"loc": "upper left", "bbox_to_anchor": (1.005, 1.05), "borderaxespad": 0.0}
        axis.legend(once.values(), once.keys(), handlelength=2.4, **place)


def _line(axis: Axes, line: Series, points: int) -> None:
    role = ROLES[line.role]
    time, value = thinned(line.time, line.value, points)
    dash = role.dash if line.dash is None else line.dash
    # In points of 1/72 inch, and in widths of the line, as matplotlib has them.
    width = 0.75 * role.width
    style: Any = (0, tuple(d / max(role.width, 1.0) for d in dash)) if dash else "-"
    # What was measured lies on top, thin, so that neither hides the other.
    order = 3.0 if line.role == "measured" else 2.0 + 0.01 / max(role.width, 0.1)
    order = order if line.line else 0.1 * order + 1.5  # dots below the lines that they lie about
    axis.plot(
        time,
        value,
        color=role.light,
        linewidth=width,
        linestyle=style if line.line else "none",
        marker=("s" if line.square else "o") if line.marks else None,
        markersize=4.5 if line.square else 3,
        label=line.label,
        zorder=order,
    )
    if line.error is not None:
        axis.errorbar(
            line.time, line.value, yerr=line.error, fmt="none", ecolor=role.light, elinewidth=0.8, zorder=1.5
        )


def histogram(values: Sequence[tuple[str, NDArray[np.float64]]], x_label: str, limit: float) -> Figure:
    """Return a histogram (outline, logarithmic count) of each named sample; what exceeds `limit` is put in
    the last bin.
    """
    roles = ("measured", "second", "third", "fourth")
    with styled():
        figure = blank(10.0, 2.3)
        axis = figure.subplots()
        edges = np.linspace(0.0, limit, 81)
        for number, (label, sample) in enumerate(values):
            role = ROLES[roles[number % len(roles)]]
            axis.hist(
                np.clip(sample, 0.0, limit),
                edges.tolist(),
                histtype="step",
                color=role.light,
                label=label,
                linewidth=1.3,
                linestyle=(0, role.dash) if role.dash else "-",
            )
        axis.set_yscale("log")
        axis.set_xlabel(x_label)
        axis.set_ylabel("samples")
        if len(values) > 1:
            axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.05), borderaxespad=0.0, handlelength=1.5)
    return figure


def save_png(picture: Plot | Figure, path: str | Path, dpi: int = 130) -> Path:
    """Write a plot or a figure as a PNG on white and return the path."""
    figure = still(picture) if isinstance(picture, Plot) else picture
    with styled():
        _lay_out(figure)
        figure.savefig(path, dpi=dpi, facecolor="white")
    return Path(path)


def inline_svg(figure: Figure, prefix: str, description: str = "") -> str:
    """Return the figure as an `<svg>` element for a page: colours as CSS variables, identifiers begin with
    `prefix`.
    """
    buffer = io.StringIO()
    with styled():
        _lay_out(figure)
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{prefix}-', svg)
    svg = re.sub(r"url\(#", f"url(#{prefix}-", svg)
    svg = re.sub(r'href="#', f'href="#{prefix}-', svg)
    for colour, name in CSS_VARIABLE.items():
        svg = svg.replace(colour, f"var({name})")
    svg = re.sub(r'(<svg[^>]*?)\swidth="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?)\sheight="[^"]*"', r"\1", svg, count=1)
    return svg.replace("<svg", f'<svg role="img" aria-label="{html.escape(description, quote=True)}"', 1)


def _lay_out(figure: Figure) -> None:
    # Once for page and file together: it takes as long as drawing.
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        # None, and not "none": that leaves a place holder, for whose sake each file is drawn twice.
        figure.set_layout_engine(None)
