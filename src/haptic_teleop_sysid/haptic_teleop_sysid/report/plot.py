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
LESS = "measured less simulated"
"""What a residual view shows where nothing else is said."""
#: Samples up to which their names stand at the axis.
MOST_NAMED = 12
#: Room above and below the lines, as a share of the axis.
_ROOM = 0.06
#: Decades of a logarithmic axis from which it has a number at whole decades only.
_MANY_DECADES = 3.0


@dataclass(frozen=True)
class Series:
    """A line of a panel: ``time`` and ``value``, both (n,); NaN leaves a gap. ``role``: what it means, of
    `ROLES`; ``dash``: lengths of stroke and gap instead of the role's; ``marks``: a dot at each sample, a
    square with ``square``; ``line``: whether they are joined; ``error`` (n,): what each may be off by, a
    bar up and down."""

    label: str
    time: Array
    value: Array
    role: str = "measured"
    dash: tuple[int, ...] | None = None
    marks: bool = False
    line: bool = True
    square: bool = False
    error: Array | None = None

    def reaches(self) -> tuple[Array, Array]:
        """Values (n,), (n,), from and up to which it is drawn; where an error is not known, the value."""
        error = 0.0 if self.error is None else np.nan_to_num(self.error)
        return self.value - error, self.value + error


@dataclass(frozen=True)
class Band:
    """What lies between ``low`` and ``high`` at ``time``, all (n,) and finite."""

    label: str
    time: Array
    low: Array
    high: Array


@dataclass(frozen=True)
class Panel:
    """One axes: title, unit, lines, horizontal ``guides``, shaded ``spans`` (start, end), vertical lines at
    ``moments``, a ``band`` behind the lines, and a ``note`` such as the fits; ``x_label``: of this panel
    alone, which then has an axis of its own; ``logarithmic``: its values are positive, and so is its axis."""

    title: str
    unit: str
    series: Sequence[Series]
    guides: Sequence[float] = ()
    spans: Sequence[tuple[float, float]] = ()
    note: str = ""
    x_label: str = ""
    moments: Sequence[float] = ()
    band: Band | None = None
    logarithmic: bool = False

    def limits(self) -> tuple[float, float]:
        """Lowest and highest value of its vertical axis: of all lines and guides, with some room, and no less
        high than LEAST_HEIGHT."""
        reach = [s.reaches() for s in self.series]
        reach += [] if self.band is None else [(self.band.low, self.band.high)]
        ends = [(extremes(a)[0], extremes(b)[1]) for a, b in reach] + [(g, g) for g in self.guides]
        low = min((a for a, _ in ends if np.isfinite(a)), default=0.0)
        high = max((b for _, b in ends if np.isfinite(b)), default=0.0)
        if self.logarithmic:
            low = max(low, min((extremes(s.value)[0] for s in self.series), default=low))
            room = max(_ROOM * np.log(high / low), 0.02)
            return low * float(np.exp(-room)), high * float(np.exp(room))
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


@dataclass(frozen=True, eq=False)
class Plot:
    """``panels`` one below the other over a common axis ``x_label``; ``difference``: what is shown on request
    instead, one below the other, and ``difference_of`` in words what that is; ``names`` of the samples, told
    under the mouse and at the keyboard's cursor, and beside the axis where they are few and the samples stand
    at 1, 2, 3; ``dated``: times are seconds since 1970, UTC."""

    panels: Sequence[Panel]
    x_label: str = "time (s)"
    difference: Sequence[Panel] = ()
    names: Sequence[str] = ()
    dated: bool = False
    difference_of: str = LESS

    @property
    def over_time(self) -> bool:
        """Whether all its panels lie over time."""
        labels = {p.x_label or self.x_label for p in self.panels}
        return self.dated or all(label.startswith("time") for label in labels)

    @property
    def named_ticks(self) -> bool:
        """Whether the names stand at the axis."""
        return 0 < len(self.names) <= MOST_NAMED and not self.dated

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
    return Panel(f"{panel.title}: {LESS}", panel.unit, others, (0.0,), panel.spans)


def extremes(value: Array) -> tuple[float, float]:
    """Least and greatest finite value of (n,) values, NaN without any."""
    finite = value[np.isfinite(value)]
    return (float(finite.min()), float(finite.max())) if len(finite) else (float("nan"), float("nan"))


def log_ticks(low: float, high: float) -> list[float]:
    """Round values for a logarithmic axis from ``low`` to ``high`` and for what one pans to: 1, 2 and 5 of
    each decade, or 1 alone where there are many."""
    first, last = (int(np.floor(np.log10(end))) for end in (low, high))
    mantissas = (1, 2, 5) if np.log10(high / low) < _MANY_DECADES else (1,)
    return [float(f"{m}e{power}") for power in range(first - 1, last + 2) for m in mantissas]


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
