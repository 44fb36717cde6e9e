"""The uniform times of a data set, and how recorded values get there: unchanged wherever stamps permit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import JointStateSeries

Array = NDArray[np.float64]
NS = 1e-9
IRREGULAR = 0.01
"""Stamps off the uniform grid by more than this share of a period make resampling necessary."""
GAP_PERIODS = 5.0
"""A longer hole, in periods, is not bridged: samples within it are not valid."""
STRAYS = 1
"""Messages in a row stamped in the past that may have strayed there; more of them mean a clock set back."""
FEWEST_VALID = 0.5
"""Share of the time that must have been measured, so that leaving out holes makes sense."""


def period_text(seconds: float) -> str:
    """A sampling period with the unit in which it reads well: 2 s, 2 ms, 50 µs."""
    unit, factor = ("s", 1.0) if seconds >= 1.0 else ("ms", 1e3) if seconds >= 1e-3 else ("µs", 1e6)
    return f"{seconds * factor:.4g} {unit}"


@dataclass(frozen=True)
class TimeGrid:
    """`keep` picks usable messages; `stamps` their times, ns; `at` the uniform times; values are interpolated
    if `resampled`; `set_back`: where the clock was set back, (s, messages that are in the past), not `valid`
    from there on for a while, because what comes next happened later than it says.
    """

    keep: NDArray[np.intp]
    stamps: NDArray[np.int64]
    at: NDArray[np.float64]
    dt: float
    resampled: bool
    valid: NDArray[np.bool_]
    set_back: tuple[tuple[float, int], ...] = ()

    @classmethod
    def of(cls, series: JointStateSeries, name: str) -> TimeGrid:
        """Return the grid of a series; holes and samples behind a clock that was set back are not valid.
        ``name`` is for sentences.

        Raises RecordingError for fewer than ten usable samples, or where less than FEWEST_VALID of the time
        was measured.
        """
        # A message stamped not later than one before it adds nothing that can be placed in time.
        ahead = np.maximum.accumulate(series.stamp)
        keep = (
            np.flatnonzero(np.concatenate([[True], series.stamp[1:] > ahead[:-1]]))
            if len(series)
            else np.zeros(0, int)
        )
        stamps = series.stamp[keep]
        if len(stamps) < 10:
            unusable = len(series) - len(stamps)
            raise RecordingError(
                f"{name} has {len(stamps)} usable samples and at least ten are needed"
                + (f"; {unusable} more are stamped not later than one before them: mend the stamps, or "
                   if unusable else ": ")
                + "record longer."
            )  # fmt: skip
        steps = np.diff(stamps) * NS
        period = float(np.median(steps))
        share = len(stamps) * period / max(period, (stamps[-1] - stamps[0]) * NS)
        if share < FEWEST_VALID:
            raise RecordingError(
                f"{name}: its stamps span {(stamps[-1] - stamps[0]) * NS:.6g} s, of which "
                f"{100.0 * (1.0 - share):.3g} % are holes: record again, or mend the stamps."
            )
        n = round((stamps[-1] - stamps[0]) * NS / period) + 1
        dt = float((stamps[-1] - stamps[0]) * NS / (n - 1))
        at = dt * np.arange(n, dtype=np.float64)
        since = (stamps - stamps[0]) * NS
        regular = n == len(stamps) and float(np.max(np.abs(since - at))) <= IRREGULAR * dt
        if not regular:
            dt, n = period, int(np.floor((stamps[-1] - stamps[0]) * NS / period * (1 + 1e-12))) + 1
            at = dt * np.arange(n, dtype=np.float64)
        valid = np.ones(n, dtype=np.bool_)
        for hole in np.flatnonzero(steps > GAP_PERIODS * period):
            valid[(at > since[hole] + 0.5 * dt) & (at < since[hole + 1] - 0.5 * dt)] = False
        set_back = _set_back(keep, series.stamp, since)
        for start, _ in set_back:
            valid[(at >= start - 0.5 * dt) & (at <= start + (GAP_PERIODS + 0.5) * dt)] = False
        return cls(keep, stamps, at, dt, not regular, valid, set_back)

    def sampled(self, values: Array) -> Array:
        """Bring values of all messages, (m,), to the grid (n,), linearly between messages when resampling;
        where some are not finite, between those that are, and not a number where one that is not lies between
        these and both are farther away than half a period."""
        kept = values[self.keep]
        if not self.resampled:
            return kept
        good, since = np.isfinite(kept), (self.stamps - self.stamps[0]) * NS
        if good.all() or not good.any():
            return np.interp(self.at, since, kept)
        found, read = np.interp(self.at, since[good], kept[good]), np.flatnonzero(good)
        after = np.clip(np.searchsorted(since[read], self.at), 1, len(read) - 1) if len(read) > 1 else 0
        ahead, behind = read[after], read[after - 1]
        away = np.minimum(np.abs(self.at - since[ahead]), np.abs(self.at - since[behind]))
        return np.where((away <= (0.5 + IRREGULAR) * self.dt) | (ahead - behind == 1), found, np.nan)


def _set_back(
    keep: NDArray[np.intp], stamp: NDArray[np.int64], since: Array
) -> tuple[tuple[float, int], ...]:
    """Where several messages in a row lie in the past (STRAYS), or more than GAP_PERIODS repeat a stamp: time
    of the first kept one behind them (of `since`, s), and how many they are."""
    behind = np.concatenate([[0], np.cumsum(stamp < np.maximum.accumulate(stamp))])
    edges = np.append(keep, len(stamp))
    left_out = np.diff(edges) - 1
    past = behind[edges[1:]] - behind[keep]
    found = np.flatnonzero(((past > 0) & (left_out > STRAYS)) | (left_out > GAP_PERIODS))
    return tuple((float(since[min(i + 1, len(since) - 1)]), int(left_out[i])) for i in found)
