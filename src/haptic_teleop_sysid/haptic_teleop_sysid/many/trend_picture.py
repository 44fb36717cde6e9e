"""A trend as pictures: each quantity over time with its limits, and what changed since the reference."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.report import Band, Panel, Plot, Series, unit_text
from haptic_teleop_sysid.report.pictures import COLOUR, INK, blank, styled

from .charts import Chart
from .trend import Trend

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.figure import Figure

FloatArray = NDArray[np.float64]
_VALUE, _OUT = COLOUR["measured"], COLOUR["alarm"]


def charts_plot(trend: Trend) -> Plot:
    """Return one panel a quantity: values with standard errors, reference, limits, what is outside."""
    dates = [p.date for p in trend.points]
    dated = all(d is not None for d in dates)
    times = [d.timestamp() for d in dates if d is not None] if dated else range(1, len(dates) + 1)
    x = np.array(times, dtype=float)
    panels = [_panel(x, c, trend) for c in trend.charts]
    names = [p.name for p in trend.points]
    return Plot(panels, "date (UTC)" if dated else "recording", names=names, dated=dated)


def changes_picture(trend: Trend) -> Figure:
    """Return what each quantity is now against the reference, with two standard errors: parameters in
    percent, errors as a factor."""
    parts = [
        [c for c in reversed(trend.charts) if c.quantity.logarithmic is which] for which in (False, True)
    ]
    from matplotlib.ticker import LogLocator

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
            # The first and the last row stand clear of the axis.
            axes.set_ylim(-0.6, max(len(part), 1) - 0.4)
        panels[1].set_xscale("log")
        panels[1].xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
        panels[1].xaxis.set_major_formatter("{x:g}")
        panels[1].xaxis.set_minor_formatter("")
    return figure


def _against(c: Chart, errors: float) -> float:
    """The quantity now, so many standard errors away, against its reference: a factor for a logarithmic one,
    else percent."""
    away = c.now + errors * c.now_std - c.centre
    return float(np.exp(away)) if c.quantity.logarithmic else 100.0 * away / max(abs(c.centre), 1e-300)


def _panel(x: FloatArray, c: Chart, trend: Trend) -> Panel:
    shown = np.vectorize(c.shown, otypes=[float])
    values, told = c.quantity.values, np.isfinite(c.half)
    low, high = (shown(c.centre + sign * c.half[told]) for sign in (-1.0, 1.0))
    series = [Series("recordings, std. error", x, values, marks=True, line=False, error=c.quantity.std)]
    for which, label, role, square in (
        (c.creeping & ~c.single, "crept out", "given", False),
        (c.single, "jumped out", "alarm", True),
    ):
        if np.any(which):
            outside = np.where(which, values, np.nan)
            series.append(Series(label, x, outside, role, marks=True, line=False, square=square))
    return Panel(
        c.quantity.name,
        unit_text(c.quantity.unit),
        series,
        guides=(c.shown(c.centre),),
        spans=((float(x[0]), float(x[trend.reference - 1])),),
        moments=[float(x[i]) for i in trend.events],
        band=Band("limits of one recording", x[told], low, high),
        logarithmic=c.quantity.logarithmic,
    )
