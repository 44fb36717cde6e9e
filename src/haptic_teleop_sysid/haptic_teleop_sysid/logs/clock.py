"""When the rows of a log are from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.mapping import Mapping
from haptic_teleop_sysid.logs.signals import unit_in_force
from haptic_teleop_sysid.recordings.time_grid import GAP_PERIODS

ORIGIN = 1_000_000_000
"""s, where a time counts from that is no date: a stamp of zero means "none" to ROS."""
_DATES = 3e8, 4e9
_FEWEST = 10
#: Share of rows that repeat the time of the one before, from which it was written too coarsely.
_COARSE = 0.2
#: Rates, Hz, outside of which a unit of time is in doubt.
SLOWEST, FASTEST = 5.0, 100_000.0
BACK = "time goes back"
"""How a sentence on times that do so begins."""


def stamps_of(
    log: Log, mapping: Mapping, column: Column, told: list[str]
) -> tuple[NDArray[np.int64], NDArray[np.intp], str]:
    """Return (stamps ns, which rows they are of, where they are from) of a column's rows; what is odd about
    them is `told`.

    Raises ConfigurationError where nothing says when the rows are from, RecordingError for times that
    cannot be used.
    """
    rows = np.arange(len(column.values))
    if mapping.rate is not None:
        told.append(f"no time is read: the rows were taken at {mapping.rate:g} Hz, as the mapping says")
        return ORIGIN * 10**9 + np.rint(1e9 * rows / mapping.rate).astype(np.int64), rows, "rate"
    if mapping.time is None:
        if column.group in log.stamps:
            stamps = log.stamps[column.group]
            _judge(stamps, log, told)
            return stamps, rows, f"stamps of {column.group}"
        raise ConfigurationError(
            f"{mapping.source} does not say when the rows of {log.path} are from: give time: {{column: ..., "
            "unit: ...}, or time: {rate: HZ}."
        )
    clock = log.find(mapping.time.column)
    if clock.text is not None:
        raise RecordingError(
            f"{log.path}: the time {clock.holds_text}, or give time: {{rate: HZ}} in the mapping."
        )
    if clock.group != column.group or len(clock.values) != len(column.values):
        raise RecordingError(
            f"{log.path}: the time {clock.name!r} has {len(clock.values)} rows and {column.name!r} "
            f"{len(column.values)}: name columns of one length."
        )
    unit = unit_in_force(log, clock, mapping.time, "time", mapping.source)
    if unit.quantity != "time":
        raise ConfigurationError(f"{mapping.source}: time is in {unit.text}: give s, ms, us or ns.")
    rows = np.flatnonzero(np.isfinite(clock.values))
    if len(rows) < len(clock.values):
        told.append(f"{counted(len(clock.values) - len(rows), 'row')} without a time left out")
    seconds = clock.values[rows] * unit.factor
    if len(rows) < _FEWEST:
        raise RecordingError(
            f"{log.path} has {counted(len(rows), 'row')} with a time: at least {_FEWEST} are needed."
        )
    told.append(f"time: column {clock.name!r} in {unit.text}")
    origin = 0.0
    if not _DATES[0] < float(np.min(seconds)) < _DATES[1]:
        if float(np.max(np.abs(seconds))) > _DATES[0]:
            raise RecordingError(
                f"{log.path}: the time {clock.name!r} in {unit.text} reaches {np.max(np.abs(seconds)):.3g} "
                "s, which is neither a time since the start nor since 1970: give another unit (ms, us, ns)."
            )
        origin = float(ORIGIN)
    stamps = np.rint(1e9 * seconds).astype(np.int64) + int(origin) * 10**9
    _judge(stamps, log, told)
    return stamps, rows, f"column {clock.name!r}"


def _since(stamps: NDArray[np.int64], row: int) -> float:
    return float(stamps[row] - stamps[0]) * 1e-9


def _judge(stamps: NDArray[np.int64], log: Log, told: list[str]) -> None:
    """Tell what is odd about times; refuse what cannot be one recording."""
    steps = np.diff(stamps) * 1e-9
    forward = steps[steps > 0.0]
    if len(stamps) < _FEWEST or not len(forward):
        raise RecordingError(f"{log.path}: its time does not go on: name another column for time, or a rate.")
    period = float(np.median(forward))
    back = np.flatnonzero(steps < 0.0)
    for row in back.tolist():
        since = (stamps[row] - stamps[0]) * 1e-9
        if -steps[row] > 0.5 * since and since > 10.0 * period:
            raise RecordingError(
                f"{log.path}: the time starts anew at row {row + 2} (from {since:.6g} s to "
                f"{since + steps[row]:.6g} s after the first): the file holds several recordings; import "
                f"them one by one, the first with --rows 1 {row + 1}."
            )
    if len(back):
        told.append(
            f"{BACK} {counted(len(back), 'time')}, first at row {int(back[0]) + 2}, from "
            f"{_since(stamps, back[0]):.6g} s to {_since(stamps, back[0] + 1):.6g} s after the first: these "
            "stamps are kept, and what uses the recording leaves such samples out or refuses them"
        )
    repeats = int(np.sum(steps == 0.0))
    if repeats > _COARSE * len(steps):
        raise RecordingError(
            f"{log.path}: {repeats} of {len(stamps)} rows repeat the time of the one before: it was written "
            "too coarsely; give time: {rate: HZ} in the mapping."
        )
    if repeats:
        told.append(f"{counted(repeats, 'row repeats', 'rows repeat')} the time of the one before")
    holes = np.flatnonzero(steps > GAP_PERIODS * period)
    if len(holes):
        worst = int(holes[np.argmax(steps[holes])])
        told.append(
            f"{counted(len(holes), 'hole')} in time of more than {GAP_PERIODS:g} periods, the longest of "
            f"{steps[worst]:.6g} s behind row {worst + 1}"
        )
    if not SLOWEST <= 1.0 / period <= FASTEST:
        told.append(
            f"its rows are {period:.4g} s apart, {1.0 / period:.4g} a second, which is "
            f"{'slow' if 1.0 / period < SLOWEST else 'fast'} for a joint: is the time in another unit?"
        )
