"""What a plot shows, apart from who draws it: lines in panels over one axis.

`pictures` draws it for paper, for files and where scripts are off, `live` for a page on which one zooms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Least height of an axis by unit: what varies by less is noise or rounding, and is shown as the flat line
#: that it is. A tenth of what an encoder of the 2DSFJ resolves, and as much of torques and currents.
LEAST_HEIGHT = {"rad": 1e-4, "rad/s": 1e-3, "N·m": 1e-3, "A": 1e-3, "mJ": 1e-2, "m": 1e-6} | {
    "m/s": 1e-5,
    "N": 1e-3,
}
#: Room above and below the lines, as a share of the axis.
_ROOM = 0.06


@dataclass(frozen=True)
class Series:
    """A line of a panel: ``time`` and ``value``, both (n,); NaN leaves a gap. ``role``: what it means, of
    `ROLES`; ``dash``: lengths of stroke and gap instead of the role's; ``marks``: a dot at each sample;
    ``line``: whether they are joined."""

    label: str
    time: Array
    value: Array
    role: str = "measured"
    dash: tuple[int, ...] | None = None
    marks: bool = False
    line: bool = True


@dataclass(frozen=True)
class Panel:
    """One axes: title, unit, lines, horizontal ``guides``, shaded ``spans`` (start, end), and a ``note`` such
    as the fits; ``x_label``: of this panel alone, which then has an axis of its own."""

    title: str
    unit: str
    series: Sequence[Series]
    guides: Sequence[float] = ()
    spans: Sequence[tuple[float, float]] = ()
    note: str = ""
    x_label: str = ""

    def limits(self) -> tuple[float, float]:
        """Lowest and highest value of its vertical axis: of all lines and guides, with some room, and no less
        high than LEAST_HEIGHT."""
        ends = [extremes(s.value) for s in self.series] + [(g, g) for g in self.guides]
        low = min((a for a, _ in ends if np.isfinite(a)), default=0.0)
        high = max((b for _, b in ends if np.isfinite(b)), default=0.0)
        least = LEAST_HEIGHT.get(self.unit, 0.0)
        height = max(high - low, least, 1e-6 * max(abs(low), abs(high))) or 1.0
        middle, half = 0.5 * (low + high), (0.5 + _ROOM) * height
        return middle - half, middle + half

    @property
    def flat(self) -> bool:
        """Whether all lines together vary by less than what is worth looking at."""
        ends = [e for e in (extremes(s.value) for s in self.series) if np.isfinite(e[0])]
        if not ends or self.unit not in LEAST_HEIGHT:
            return False
        return max(b for _, b in ends) - min(a for a, _ in ends) < LEAST_HEIGHT[self.unit]


@dataclass(frozen=True)
class Plot:
    """``panels`` one below the other over a common axis ``x_label``; ``difference``: what is shown on request
    instead, one below the other."""

    panels: Sequence[Panel]
    x_label: str = "time (s)"
    difference: Sequence[Panel] = ()

    def with_difference(self) -> Plot:
        """The same plot with the residual view: in each panel that has a measured line, that line less each
        of the others."""
        found = [differences(p) for p in self.panels if sum(s.role == "measured" for s in p.series) == 1]
        return replace(self, difference=[p for p in found if p.series])

    def legend(self) -> list[Series]:
        """The lines that a legend tells, each label once."""
        return list({s.label: s for p in self.panels for s in p.series if s.label}.values())

    def lines(self) -> int:
        """How many lines it has in all."""
        return sum(len(p.series) for p in (*self.panels, *self.difference))


def differences(panel: Panel) -> Panel:
    """The panel of the measured line less each other one that has its samples."""
    measured = next(s for s in panel.series if s.role == "measured")
    others = [
        replace(s, value=measured.value - s.value)
        for s in panel.series
        if s is not measured and len(s.value) == len(measured.value) and s.role != "reference"
    ]
    return Panel(f"{panel.title}: measured less simulated", panel.unit, others, (0.0,), panel.spans)


def extremes(value: Array) -> tuple[float, float]:
    """Least and greatest finite value of (n,) values, NaN without any."""
    finite = value[np.isfinite(value)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (float("nan"), float("nan"))


def thinned(time: Array, value: Array, points: int) -> tuple[Array, Array]:
    """Return (time, value) with at most about ``points`` samples: the least and the greatest of each bin, in
    their order, and both ends, so that no peak is lost; a bin without any number stays a gap."""
    n = len(time)
    if n <= max(points, 4):
        return time, value
    size = int(np.ceil(n / max(points // 2, 1)))
    bins = np.pad(value.astype(float), (0, -n % size), constant_values=np.nan).reshape(-1, size)
    low = np.argmin(np.where(np.isnan(bins), np.inf, bins), axis=1)
    high = np.argmax(np.where(np.isnan(bins), -np.inf, bins), axis=1)
    start = np.arange(len(bins)) * size
    index = np.unique(np.concatenate([start + low, start + high, [0, n - 1]]))
    return time[index], value[index]
