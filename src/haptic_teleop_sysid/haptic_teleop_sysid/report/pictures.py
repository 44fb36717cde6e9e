"""Matplotlib figures in the page's colours, as inline SVG for the page and as PNG beside it.

Lines are drawn in fixed colours; for the page each of them becomes a CSS variable, so that one picture is
legible on white, on dark and on paper. Long series are thinned to the extremes of each bin: nothing that can
be seen is lost and the page stays small.
"""

from __future__ import annotations

import html
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

INK, GRID, SHADE = "#1c2431", "#dfe3ea", "#e9edf4"
SERIES_COLOURS = ("#1c2432", "#2166ad", "#c2570d", "#1a7f5b", "#7b3fa1", "#a8123f", "#6b6b13")
CSS_VARIABLE = {INK: "--ink", GRID: "--grid", SHADE: "--shade"} | {
    c: f"--s{i}" for i, c in enumerate(SERIES_COLOURS)
}
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


@dataclass(frozen=True)
class Series:
    """A line of a panel: `time` (s) and `value`, both (n,); `colour` indexes SERIES_COLOURS; NaN leaves a
    gap.
    """

    label: str
    time: NDArray[np.float64]
    value: NDArray[np.float64]
    colour: int = 1
    style: str = "-"
    width: float = 1.3


@dataclass(frozen=True)
class Panel:
    """One axes of a stack: its title, its unit, its lines, horizontal guides and shaded spans (start, end,
    s).
    """

    title: str
    unit: str
    series: Sequence[Series]
    guides: Sequence[float] = ()
    spans: Sequence[tuple[float, float]] = ()


def thinned(time: NDArray[np.float64], value: NDArray[np.float64], points: int = POINTS):
    """Return (time, value) with at most about `points` samples: the least and the greatest of each bin, in
    their order.
    """
    n = len(time)
    if n <= points:
        return time, value
    size = int(np.ceil(n / (points // 2)))
    bins = value[: n - n % size].reshape(-1, size)
    filled = np.where(np.isnan(bins), np.inf, bins)
    low = np.argmin(filled, axis=1)
    high = np.argmax(np.where(np.isnan(bins), -np.inf, bins), axis=1)
    start = np.arange(len(bins)) * size
    index = np.unique(np.concatenate([start + low, start + high, [0, n - 1]]))
    return time[index], value[index]


def stacked_panels(
    panels: Sequence[Panel], x_label: str = "time (s)", width: float = 10.0, height: float = 1.75
) -> Figure:
    """Return a figure with the panels one below the other over a common time axis; `width` and `height` of
    one in inches.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(width, height * len(panels) + 0.5), layout="constrained")
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axis, panel in zip(axes, panels, strict=True):
            for start, end in panel.spans:
                axis.axvspan(start, end, color=SHADE, linewidth=0, zorder=0)
            for level in panel.guides:
                axis.axhline(level, color=INK, linewidth=0.7, linestyle=(0, (2, 3)), zorder=1)
            for line in panel.series:
                time, value = thinned(line.time, line.value)
                colour = SERIES_COLOURS[line.colour % len(SERIES_COLOURS)]
                axis.plot(time, value, line.style, color=colour, linewidth=line.width, label=line.label)
            axis.set_title(panel.title)
            axis.set_ylabel(panel.unit)
            axis.margins(x=0.005)
            if sum(bool(line.label) for line in panel.series) > 1:
                axis.legend(
                    loc="upper left", bbox_to_anchor=(1.005, 1.05), borderaxespad=0.0, handlelength=1.5
                )
        axes[-1].set_xlabel(x_label)
        figure.align_ylabels(list(axes))
    return figure


def histogram(values: Sequence[tuple[str, NDArray[np.float64]]], x_label: str, limit: float) -> Figure:
    """Return a histogram (outline, logarithmic count) of each named sample; what exceeds `limit` is put in
    the last bin.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 2.3), layout="constrained")
        axis = figure.subplots()
        edges = np.linspace(0.0, limit, 81)
        for number, (label, sample) in enumerate(values, start=1):
            colour = SERIES_COLOURS[number % len(SERIES_COLOURS)]
            axis.hist(
                np.clip(sample, 0.0, limit),
                edges.tolist(),
                histtype="step",
                color=colour,
                label=label,
                linewidth=1.3,
            )
        axis.set_yscale("log")
        axis.set_xlabel(x_label)
        axis.set_ylabel("samples")
        if len(values) > 1:
            axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.05), borderaxespad=0.0, handlelength=1.5)
    return figure


def save_png(figure: Figure, path: str | Path, dpi: int = 130) -> Path:
    """Write the figure as a PNG on white and return the path."""
    with matplotlib.rc_context(STYLE):
        _lay_out(figure)
        figure.savefig(path, dpi=dpi, facecolor="white")
    return Path(path)


def inline_svg(figure: Figure, prefix: str, description: str = "") -> str:
    """Return the figure as an `<svg>` element for a page: colours as CSS variables, identifiers begin with
    `prefix`.
    """
    buffer = io.StringIO()
    with matplotlib.rc_context(STYLE):
        _lay_out(figure)
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{prefix}-', svg)
    svg = re.sub(r"url\(#", f"url(#{prefix}-", svg)
    svg = re.sub(r'href="#', f'href="#{prefix}-', svg)
    for colour, variable in CSS_VARIABLE.items():
        svg = svg.replace(colour, f"var({variable})")
    svg = re.sub(r'(<svg[^>]*?)\swidth="[^"]*"', r"\1", svg, count=1)
    svg = re.sub(r'(<svg[^>]*?)\sheight="[^"]*"', r"\1", svg, count=1)
    return svg.replace("<svg", f'<svg role="img" aria-label="{html.escape(description, quote=True)}"', 1)


def _lay_out(figure: Figure) -> None:
    # Once for page and file together: it takes as long as drawing.
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
