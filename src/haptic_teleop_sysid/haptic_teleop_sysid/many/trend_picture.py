"""A trend as pictures: each quantity over time with its limits, and what changed since the reference."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from haptic_teleop_sysid.report import unit_text
from haptic_teleop_sysid.report.pictures import COLOUR, INK, SHADE, blank, styled

from .charts import Chart
from .trend import Trend

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_VALUE, _OUT, _CREPT = COLOUR["measured"], COLOUR["alarm"], COLOUR["given"]


def charts_picture(trend: Trend) -> Figure:
    """Return one panel a quantity: values with standard errors, reference, limits, what is outside."""
    x, label = _axis(trend)
    with styled():
        figure = blank(10.0, 1.7 * len(trend.charts) + 0.6)
        panels = figure.subplots(len(trend.charts), 1, sharex=True, squeeze=False)[:, 0]
        for axes, c in zip(panels, trend.charts, strict=True):
            _panel(axes, x, c, trend)
        panels[-1].set_xlabel(label)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
    return figure


def changes_picture(trend: Trend) -> Figure:
    """Return what each quantity is now against the reference, with two standard errors: parameters in
    percent, errors as a factor."""
    parts = [
        [c for c in reversed(trend.charts) if c.quantity.logarithmic is which] for which in (False, True)
    ]
    with styled():
        heights = [max(len(part), 1) for part in parts]
        figure = blank(8.0, 0.34 * sum(heights) + 1.6)
        panels = figure.subplots(2, 1, height_ratios=heights)
        for axes, part, factors in zip(panels, parts, (False, True), strict=True):
            for place, c in enumerate(part):
                now, low, high = (_against(c, k) for k in (0.0, -2.0, 2.0))
                colour = _OUT if c.outside[-1] else _VALUE
                error = [[now - low], [high - now]]
                axes.errorbar(now, place, xerr=error, fmt="o", color=colour, capsize=3)
            axes.axvline(1.0 if factors else 0.0, color=INK, linewidth=0.8)
            # Long names on two lines: the layout leaves them too little room.
            names = [c.quantity.name.replace(".", "\n", 1).replace(", ", "\n", 1) for c in part]
            axes.set_yticks(range(len(part)), names)
            axes.set_xlabel("now / reference" if factors else "change since the reference (%)")
        panels[1].set_xscale("log")
    return figure


def _against(c: Chart, errors: float) -> float:
    """The quantity now, so many standard errors away, against its reference: a factor for a logarithmic one,
    else percent."""
    away = c.now + errors * c.now_std - c.centre
    return float(np.exp(away)) if c.quantity.logarithmic else 100.0 * away / max(abs(c.centre), 1e-300)


def _axis(trend: Trend) -> tuple[Any, str]:
    dates = [p.date for p in trend.points]
    if all(d is not None for d in dates):
        return np.array([np.datetime64(d.replace(tzinfo=None)) for d in dates if d is not None]), "date (UTC)"
    return np.arange(1, len(dates) + 1), "recording"


def _panel(axes: Axes, x: Any, c: Chart, trend: Trend) -> None:
    shown = np.vectorize(c.shown, otypes=[float])
    values = c.quantity.values
    told = np.isfinite(c.half)
    axes.fill_between(
        x[told],
        shown(c.centre - c.half[told]),
        shown(c.centre + c.half[told]),
        color=SHADE,
        linewidth=0,
        label="limits of one recording",
    )
    axes.axhline(c.shown(c.centre), color=INK, linewidth=0.7, linestyle=(0, (2, 3)))
    axes.errorbar(
        x, values, yerr=c.quantity.std, fmt=".", color=_VALUE, linewidth=0.8, label="recordings, std. error"
    )
    for which, colour, mark, label in (
        (c.creeping & ~c.single, _CREPT, "o", "crept out"),
        (c.single, _OUT, "s", "jumped out"),
    ):
        axes.plot(x[which], values[which], mark, color=colour, markersize=5, fillstyle="none", label=label)
    for i in trend.events:
        label = "event" if i == min(trend.events) else ""
        axes.axvline(x[i], color=COLOUR["fourth"], linewidth=0.8, label=label)
    axes.axvspan(x[0], x[trend.reference - 1], color=INK, alpha=0.06, linewidth=0)
    axes.set_title(c.quantity.name)
    axes.set_ylabel(unit_text(c.quantity.unit))
    if c.quantity.logarithmic:
        axes.set_yscale("log")
