"""Plots on which one zooms and pans: Bokeh documents, and its scripts, packed into the page.

A page needs no network: BokehJS travels inside, compressed (the browser unpacks it), and so do the samples of
long lines (`samples`).  Colours are names of CSS variables (``tags`` such as
``line_color=--measured``), which the page's script looks up, in the light and in the dark.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from .numbers import unit_text
from .plot import Band, Panel, Plot, Series, log_ticks, thinned
from .roles import ROLES, variable
from .samples import DRAWN, Packed

if TYPE_CHECKING:
    from bokeh.models import ColumnDataSource, Range1d
    from bokeh.models import Plot as BokehPlot

#: Height of a panel, pixels; the last one has the axis' numbers and name beside.
_HEIGHT, _AXIS = 165, 42
#: A label of an axis, and its unit.
_LABEL = re.compile(r"(.*?)\s*\(([^()]*)\)")


def available() -> bool:
    """Whether Bokeh is installed: a distribution's packages do not bring it, and pages do without."""
    return find_spec("bokeh") is not None


@cache
def packed_script() -> str:
    """BokehJS, without its widgets, compressed by gzip, as base64."""
    from bokeh.resources import Resources

    text = "\n".join(Resources(mode="inline", components=["bokeh"], log_level="warn").js_raw)
    return base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode("ascii")


def live(plot: Plot, panels: Sequence[Panel], prefix: str, packed: Packed) -> dict[str, Any]:
    """What the page's script embeds of some ``panels`` of a plot, the long lines of which are ``packed``:
    ``document`` (BokehJS' JSON), ``roots``: id of each panel's plot -> id of the element that it is drawn
    into, ``prefix`` and the panel's number, ``axes``: id -> what its axes are called when a value is told,
    ``names`` of the samples, if they are not too many to be drawn each, whether it is ``dated``, and
    ``samples``: the ``bytes`` of all long lines, and of each, by the id of its source, what they mean."""
    from bokeh.document import Document

    spans = [s for p in panels for s in (_span(line) for line in p.series) if s is not None]
    marked = any(s.marks for p in panels for s in p.series)
    shared = _range(spans, 1000.0 if plot.dated else 1.0, 0.03 if marked else 0.01)
    document, plots, roots, axes = Document(), [], {}, {}
    lines: dict[str, Any] = {}
    for number, panel in enumerate(panels):
        own = shared
        if panel.x_label:
            own = _range([s for s in map(_span, panel.series) if s is not None])
        last = number == len(panels) - 1 or bool(panel.x_label)
        label = panel.x_label or (plot.x_label if last else "")
        long = {k: told for (which, k), told in packed.lines.items() if which == number}
        one, sources = _figure(panel, own, label, last, long, plot.dated)
        lines |= sources
        if last and plot.named_ticks:
            _name_ticks(one, plot.names)
        plots.append(one)
        roots[one.id] = f"{prefix}-{number}"
        axes[one.id] = _axes(panel, panel.x_label or plot.x_label)
    with document.models.freeze():  # or it looks through all that it has after each
        for one in plots:
            document.add_root(one)
    names = list(plot.names) if len(plot.names) <= DRAWN else []
    return {
        "document": document.to_json(deferred=False),
        "roots": roots,
        "axes": axes,
        "names": names,
        "dated": plot.dated,
        "samples": {"bytes": packed.bytes_, "lines": lines},
    }


def as_script(content: Any) -> str:
    """JSON that may stand inside a `<script>` element: nothing in it ends that."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _axes(panel: Panel, x_label: str) -> dict[str, Any]:
    """``x`` and ``x_unit``: as in t = 1.2 s; ``unit`` of the values, empty for a pure number;
    ``logarithmic``."""
    parts = _LABEL.fullmatch(x_label)
    name, unit = parts.groups() if parts else (x_label, "")
    x = "t" if name.partition(" ")[0] == "time" else name or "x"
    return {"x": x, "x_unit": unit, "unit": unit_text(panel.unit), "logarithmic": panel.logarithmic}


def _name_ticks(plot: Any, names: Sequence[str]) -> None:
    from bokeh.models import FixedTicker

    places = range(1, len(names) + 1)
    plot.xaxis.ticker = FixedTicker(ticks=list(places))
    plot.xaxis.major_label_overrides = dict(zip(places, names, strict=True))
    plot.xaxis.major_label_orientation = 0.6
    plot.height += 6 * min(max(map(len, names)), 20)


def _figure(
    panel: Panel, x_range: Range1d, x_label: str, last: bool, long: dict[int, Any], dated: bool = False
) -> tuple[BokehPlot, dict[str, Any]]:
    """A panel's plot, and what is packed of its ``long`` lines (by place) by the id of their sources."""
    from bokeh.models import BasicTickFormatter, BoxAnnotation, FixedTicker, Range1d, Span
    from bokeh.plotting import figure

    low, high = panel.limits()
    plot = figure(
        height=_HEIGHT + (_AXIS if last else 0),
        sizing_mode="stretch_width",
        x_range=x_range,
        y_range=Range1d(start=low, end=high),
        x_axis_type="datetime" if dated else "linear",
        y_axis_type="log" if panel.logarithmic else "linear",
        toolbar_location=None,
        tools="",
        output_backend="canvas",
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        min_border_left=66,
        min_border_right=12,
        min_border_top=4,
    )
    _tools(plot)
    scale = 1000.0 if dated else 1.0  # Bokeh counts milliseconds
    for start, end in panel.spans:
        # As dark as the page's shade, on white and on black.
        left, right = scale * start, scale * end
        box = BoxAnnotation(left=left, right=right, fill_alpha=1.0, line_color=None, level="image")
        box.fill_color, box.tags = "#e9edf4", ["fill_color=--shade"]
        plot.add_layout(box)
    for guide in panel.guides:
        line = Span(location=guide, dimension="width", line_dash=[2, 3], level="underlay")
        line.tags = ["line_color=--ink"]
        plot.add_layout(line)
    for moment in panel.moments:
        line = Span(location=scale * moment, dimension="height", level="underlay")
        line.tags = [f"line_color={variable('fourth')}"]
        plot.add_layout(line)
    if panel.band is not None:
        _shade(plot, panel.band, scale)
    # Where the keyboard reads values.
    cursor = Span(location=0.0, dimension="height", level="overlay", line_width=2, name="cursor")
    cursor.visible, cursor.tags = False, ["line_color=--focus"]
    plot.add_layout(cursor)
    # Dots first, then wide lines, and the line of what was measured last and on top.
    order = {
        k: (s.line, s.line and s.role == "measured", -ROLES[s.role].width) for k, s in enumerate(panel.series)
    }
    sources = {}
    for place in sorted(order, key=lambda k: order[k]):
        source = _line(plot, panel.series[place], scale, place in long)
        if place in long:
            sources[source.id] = long[place]
    for axis in plot.axis:
        axis.tags = [f"{part}_color=--ink" for part in ("axis_line", "major_tick_line", "minor_tick_line")]
        axis.tags += ["major_label_text_color=--text", "axis_label_text_color=--text"]
        axis.major_label_text_font_size = axis.axis_label_text_font_size = "12px"
        axis.axis_label_text_font_style = "normal"
    if panel.logarithmic:
        # Bokeh's own ticks crowd the upper end of an axis of about one decade.
        plot.yaxis.ticker = FixedTicker(ticks=log_ticks(low, high))
        plot.yaxis.formatter = BasicTickFormatter(power_limit_low=-4, power_limit_high=5)  # pyright: ignore[reportAttributeAccessIssue]
    else:
        plot.yaxis.ticker.desired_num_ticks = 4  # pyright: ignore[reportAttributeAccessIssue]
        plot.yaxis.formatter = BasicTickFormatter(power_limit_low=-5, power_limit_high=6)  # pyright: ignore[reportAttributeAccessIssue]
    plot.grid.grid_line_color = "#dfe3ea"
    for grid in plot.grid:
        grid.tags = ["grid_line_color=--grid"]
    plot.xaxis.axis_label = x_label
    plot.xaxis.visible = last
    return plot, sources


def _tools(plot: Any) -> None:
    """Drag to zoom or to pan (the page's buttons choose), and the wheel with Ctrl."""
    from bokeh.models import BoxZoomTool, PanTool, WheelZoomTool

    box, pan = BoxZoomTool(), PanTool()
    wheel = WheelZoomTool(dimensions="width", modifiers={"ctrl": True})
    plot.add_tools(box, pan, wheel)
    plot.toolbar.active_drag = box
    plot.toolbar.active_scroll = wheel


def _shade(plot: Any, band: Band, scale: float) -> None:
    from bokeh.models import ColumnDataSource

    source: dict[str, Any] = {"x": scale * band.time, "low": band.low, "high": band.high}
    drawn = plot.varea(x="x", y1="low", y2="high", source=ColumnDataSource(source), name=band.label)
    drawn.glyph.fill_color, drawn.glyph.tags = "#cfdcef", ["fill_color==--band"]
    drawn.level = "underlay"


def _line(plot: Any, series: Series, scale: float, packed: bool) -> ColumnDataSource:
    """Draw a line and return its source, which the page's script fills where its samples are ``packed``."""
    from bokeh.models import ColumnDataSource

    role = ROLES[series.role]
    time, value = np.asarray(series.time), np.asarray(series.value)
    time, value = (time[[0, -1]], np.full(2, np.nan)) if packed else thinned(time, value, DRAWN)
    # Times are told from each other and values drawn: single precision does for both, but not for dates.
    when = np.asarray(time, np.float32) if scale == 1.0 else scale * np.asarray(time, np.float64)
    columns = {"x": when, "y": np.asarray(value, np.float32)}
    source: ColumnDataSource = ColumnDataSource(columns)
    told = {"x": "x", "y": "y", "source": source, "name": series.label or "value"}
    dash = role.dash if series.dash is None else series.dash
    style = {"line_color": role.light, "line_width": role.width, "line_dash": list(dash) or "solid"}
    if series.line:
        drawn = plot.line(**told, **style)
        drawn.glyph.tags = [f"line_color=={variable(series.role)}"]
    if series.marks:
        shape = {"marker": "square", "size": 8} if series.square else {"size": 5}
        marks = plot.scatter(**told, **shape)
        marks.glyph.fill_color = marks.glyph.line_color = role.light
        marks.glyph.tags = [f"{part}_color=={variable(series.role)}" for part in ("fill", "line")]
    if series.error is not None and len(value) == len(series.value):
        low, high = series.reaches()
        _bars(plot, columns | {"low": low, "high": high}, series.role, told["name"])
    return source


def _bars(plot: Any, source: dict[str, Any], role: str, name: str) -> None:
    from bokeh.models import ColumnDataSource

    ends = {"x0": "x", "x1": "x", "y0": "low", "y1": "high"}
    bars = plot.segment(**ends, source=ColumnDataSource(source), name=name)
    bars.glyph.line_color, bars.glyph.tags = ROLES[role].light, [f"line_color=={variable(role)}"]


def _span(series: Series) -> tuple[float, float] | None:
    finite = np.asarray(series.time)[np.isfinite(series.time)]
    return (float(finite.min()), float(finite.max())) if len(finite) else None


def _range(spans: Sequence[tuple[float, float]], scale: float = 1.0, room: float = 0.01) -> Range1d:
    """From the first to the last of ``spans``, with ``room`` at either end, a share of it all."""
    from bokeh.models import Range1d

    spans = [(scale * a, scale * b) for a, b in spans]
    low, high = min((a for a, _ in spans), default=0.0), max((b for _, b in spans), default=1.0)
    more = room * (high - low) or 0.5
    return Range1d(start=low - more, end=high + more)
