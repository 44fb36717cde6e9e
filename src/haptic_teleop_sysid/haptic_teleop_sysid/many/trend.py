"""Many recordings of one robot in time: charts of all quantities, slips, and who left the limits first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.model import Model

from .charts import Chart, Quantity, chart, first_outside
from .folder import Listing, in_order
from .kept import DONE, numbers
from .limits import FEWEST

#: s, what begins before is no date: a clock that was never set, a simulation, or a log that counts from zero.
_FIRST_DATE = 1_100_000_000
_YEAR_S = 365.25 * 86400.0
#: Recordings a year where the stamps do not say, and the fewest and most that limits are made for.
_UNDATED, _SELDOM, _OFTEN = 52, 12, 400
#: Recordings, at most, whose mean says what a quantity is now.
_LAST = 4
UNEXPLAINED, ERROR, GIVEN_ERROR = "unexplained torque", "simulated error", "simulated error, given model"


BESIDE = 3
"""Charts beside those of the parameters."""


@dataclass(frozen=True)
class Point:
    """A recording of the trend: ``found`` is what `characterise` returned."""

    name: str
    path: Path
    found: Mapping[str, Any]

    @property
    def dated(self) -> bool:
        """Whether its first stamp is a date."""
        return self.found["start_ns"] >= _FIRST_DATE * 10**9

    @property
    def date(self) -> datetime | None:
        """When it began, UTC; None without a date."""
        return datetime.fromtimestamp(self.found["start_ns"] * 1e-9, UTC) if self.dated else None

    @property
    def when(self) -> str:
        """The date and the name, for sentences."""
        return f"{self.date:%Y-%m-%d} ({self.name})" if self.date else self.name


@dataclass(frozen=True)
class Trend:
    """``points`` in order of time; ``unusable``: (name, sentence); ``charts`` of the quantities that the
    reference shows, ``unwatched``: those that it does not; ``events`` by point: what needs no chart;
    ``year``: recordings a year; ``alarms``: the probability of a false alarm in a year; ``told``: notes."""

    model: Model
    points: tuple[Point, ...]
    unusable: tuple[tuple[str, str], ...]
    reference: int
    charts: tuple[Chart, ...]
    unwatched: tuple[str, ...]
    events: dict[int, list[str]]
    year: int
    alarms: float
    told: tuple[str, ...]

    @property
    def damaged(self) -> list[str]:
        """The recordings that are broken, and were used as far as they go."""
        return [p.name for p in self.points if p.found.get("damaged")]

    @property
    def first(self) -> int | None:
        """The first recording behind the reference that leaves the limits, or has an event."""
        return first_outside(self.charts, [i for i in self.events if i >= self.reference])

    @property
    def newest(self) -> int | None:
        """The newest recording that leaves the limits of a chart."""
        found = [i for c in self.charts for i in np.flatnonzero(c.outside)]
        return int(max(found)) if found else None

    def reasons(self, index: int) -> list[str]:
        """What is out of order with a recording, in words."""
        found = list(self.events.get(index, []))
        for c in self.charts:
            if c.outside[index]:
                how = "jumped" if c.single[index] else "crept"
                found.append(f"{c.quantity.name} {how} out of its limits")
        return found


def trend_of(
    model: Model,
    outcomes: Mapping[str, Mapping[str, Any]],
    paths: Mapping[str, Path],
    reference: int,
    alarms: float,
    per_year: int | None = None,
    listing: Listing | None = None,
) -> Trend:
    """Return the trend of outcomes of `characterise` by name. ``alarms``: probability that a year in which
    nothing changes has any alarm on any chart, shared evenly among the charts (Bonferroni, so that it holds
    however they depend on each other). ``listing``: where they were found, by which undated ones are ordered.

    Raises ConfigurationError where the recordings that can be used are no more than the reference.
    """
    usable = [Point(n, paths[n], o) for n, o in outcomes.items() if o["status"] == DONE]
    unusable = [(n, str(o["message"])) for n, o in outcomes.items() if o["status"] != DONE]
    listing = listing or Listing(())
    told: list[str] = [*listing.told]
    for p in usable:
        if p.found.get("damaged"):
            told.append(f"{p.name} is broken and used as far as it goes: {'; '.join(p.found['damaged'])}")
    points = _ordered(usable, unusable, listing.typed, told)
    if len(points) <= reference:
        why = f"; the first that cannot be used: {unusable[0][1]}" if unusable else ""
        raise ConfigurationError(
            f"{counted(len(points), 'recording')} can be used, and the first {reference} are the "
            "reference: record "
            f"more, or give a smaller --reference (from {FEWEST} on){why}"
        )
    year = per_year or _per_year(points, told)
    quantities = quantities_of(points)
    alarm = alarms / len(quantities)
    last = min(_LAST, len(points) - reference)
    charts = [chart(q, reference, year, alarm, last) for q in quantities]
    shown = tuple(c for c in charts if c is not None)
    unwatched = tuple(q.name for q, c in zip(quantities, charts, strict=True) if c is None)
    told += [f"{name} does not show in enough reference recordings and is not watched" for name in unwatched]
    told += [
        f"{points[c.odd].when} stands out of the reference: it widens the limits of {c.quantity.name}"
        for c in shown
        if c.odd is not None
    ]
    told += [
        f"{c.quantity.name} is not determined by {missing} of the {len(points) - reference} recordings "
        "behind the reference, which its chart passes over"
        for c in shown
        if (missing := int(np.sum(~np.isfinite(c.score[reference:]))))
    ]
    listed, events = tuple(sorted(unusable)), _events(points, reference)
    return Trend(model, tuple(points), listed, reference, shown, unwatched, events, year, alarms, tuple(told))


def quantities_of(points: Sequence[Point]) -> list[Quantity]:
    """What is charted: each parameter with its standard errors, and logarithms of the unexplained torque and
    of the simulated errors."""
    found = []
    for name, first in points[0].found["parameters"].items():
        values, std = (
            numbers([p.found["parameters"][name][key] for p in points]) for key in ("value", "std")
        )
        found.append(Quantity(name, str(first["unit"]), values, std))
    for name, pick in (
        (UNEXPLAINED, lambda f: f["unexplained"]),
        (ERROR, lambda f: f["error"]["estimate"]),
        (GIVEN_ERROR, lambda f: f["error"]["given"]),
    ):
        values = numbers([pick(p.found) for p in points])
        found.append(Quantity(name, "1", values, None, logarithmic=True))
    return found


def _ordered(
    usable: Sequence[Point], unusable: list[tuple[str, str]], typed: bool, told: list[str]
) -> list[Point]:
    """By the first stamp of each recording's own states; names decide only between equal ones. Without any
    date as they were ``typed``, else by name."""
    if typed and not any(p.dated for p in usable):
        told.append("no recording has a date: they are in the order in which they were given")
        return list(usable)
    if not any(p.dated for p in usable):
        points = sorted(usable, key=lambda p: in_order(p.name))
        if points:
            told.append(
                "no recording has a date: they are in the order of their names, on which it depends what "
                f"changed: from {points[0].name} to {points[-1].name}"
            )
        return points
    for point in usable:
        if not point.dated:
            unusable.append((point.name, "it has no date, and the others have one: its place is unknown"))
    points = sorted((p for p in usable if p.dated), key=lambda p: (p.found["start_ns"], in_order(p.name)))
    if typed and [p.name for p in points] != [p.name for p in usable if p.dated]:
        told.append(f"in order of their own dates, not as given: {_in_a_line([p.name for p in points])}")
    for one, other in pairwise(points):
        if one.found["start_ns"] == other.found["start_ns"]:
            told.append(f"{one.name} and {other.name} begin at the same instant (copies?): ordered by name")
    return points


def _in_a_line(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 12 else f"{', '.join(names[:10])}, ... {names[-1]}"


def _per_year(points: Sequence[Point], told: list[str]) -> int:
    if not points[0].dated:
        told.append(f"without dates a year is taken to have {_UNDATED} recordings: --per-year says otherwise")
        return _UNDATED
    apart = float(np.median(np.diff([p.found["start_ns"] for p in points]))) * 1e-9
    found = round(_YEAR_S / max(apart, 1.0))
    if not _SELDOM <= found <= _OFTEN:
        told.append(
            f"the recordings come {found} times a year; limits are for {min(max(found, _SELDOM), _OFTEN)}: "
            "--per-year says otherwise"
        )
    return min(max(found, _SELDOM), _OFTEN)


def _events(points: Sequence[Point], reference: int) -> dict[int, list[str]]:
    found: dict[int, list[str]] = {}
    held = sum(p.found["error"]["given"] is not None for p in points[:reference]) > reference / 2
    for i, point in enumerate(points):
        said = [
            f"{s['encoder']} slipped by {s['size']:.3g} rad at {s['time']:.2f} s"
            for s in point.found["slips"]
        ]
        if point.found["error"]["estimate"] is None:
            said.append("its simulated response runs away")
        if held and point.found["error"]["given"] is None:
            said.append("the simulated response of the model as given runs away")
        if said:
            found[i] = said
    return found
