"""Which column of a log is the time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sysid.logs.guess import TimeGuess, guess_time
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.mapping import Entry
from haptic_teleop_sysid.logs.proposal import GUESSED, MISSING, STATED, Choice, Doubt, entry_of, left_over
from haptic_teleop_sysid.logs.roles import Candidate, counts_rows
from haptic_teleop_sysid.logs.units import unit_of

#: Share of the rows that a time has to differ from the row before.
_SELDOM = 0.01


def time_column(
    log: Log,
    candidates: Sequence[Candidate],
    lost: Sequence[Candidate],
    opened: list[Doubt],
    notes: list[str],
) -> tuple[Choice | None, TimeGuess | None]:
    """Return the column that is the time, and what it tells; both None for a log with stamps of its own, and
    where no column is one. ``lost``: candidates whose columns hold no numbers; what is open is appended to
    ``opened``, what was settled to ``notes``."""
    if log.stamps:
        return None, None
    found = [c for c in candidates if c.role == "time"]
    found = [c for c in found if not _dates_alone(c.column)] or found
    stated = [c for c in found if c.stated]
    if len(found) > 1:
        names = " and ".join(repr(c.column.name) for c in found)
        same = _same_clock(stated) if len(stated) == len(found) else False
        if same:
            notes.append(f"{names} tell the same time: the one with more digits is taken")
            found = stated = [max(stated, key=lambda c: len(np.unique(c.column.values)))]
        else:
            opened.append(Doubt(f"{names} may each be the time", signal="time"))
    if not found:
        first = [c for c in log.columns if not counts_rows(c) and guess_time(c.values, "") is not None]
        if not first:
            told = "no column is a time by its name, unit or values: give time: {rate: HZ}"
            opened.append(Doubt(told, signal="time"))
            return None, None
        guess = guess_time(first[0].values, "")
        assert guess is not None
        choice = Choice(
            replace(entry_of(log, first[0]), unit=guess.unit), GUESSED, [f"it goes up evenly; {guess.why}"]
        )
        return choice, guess
    chosen = (stated or found)[0]
    guess = guess_time(chosen.column.values, chosen.column.known)
    if chosen.stated:
        choice = Choice(entry_of(log, chosen.column), STATED, ["its unit is one of time"])
        if len(found) > 1:
            choice.less(GUESSED, "another column may be the time as well")
        for rival in lost:
            if rival.role == "time" and rival.stated:
                choice.less(GUESSED, left_over(rival))
        return choice, guess
    if guess is None:
        return Choice(
            Entry(chosen.column.name, "s"), MISSING, ["its values do not go up: give the unit"]
        ), None
    return Choice(Entry(chosen.column.name, guess.unit), guess.sure, [guess.why]), guess


def _dates_alone(column: Column) -> bool:
    """Whether a column hardly ever changes, as the date does beside a time of day."""
    return float(np.mean(np.diff(column.values) != 0.0)) < _SELDOM if len(column.values) > 1 else False


def _same_clock(clocks: Sequence[Candidate]) -> bool:
    """Whether columns of time tell the same but for their start, to a tenth of a period."""
    times = []
    for c in clocks:
        unit = unit_of(c.column.known)
        assert unit is not None
        times.append((c.column.values - c.column.values[0]) * unit.factor)
    period = float(np.median(np.abs(np.diff(times[0])))) or 1.0
    return all(
        len(t) == len(times[0]) and float(np.nanmax(np.abs(t - times[0]))) < max(0.1 * period, 1e-9)
        for t in times
    )
