"""Whether a stage oscillates by itself: a current that jumps between its limits, or a motion or torque of one
frequency that does not die away and that nobody asked for.

A command that swings is no oscillation of the loop, and contact that rings and comes to rest is none. So the
desired torque must not hold the same frequency nor move by more itself, and the amplitude must not fall
within a stretch of LEAST_CYCLES cycles or more.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from haptic_teleop_sysid.verification.signals import Array, StageRun

AT_LIMIT = 0.999
"""Share of the limit at which a current counts as being there."""
LONGEST_SWING = 0.5
"""s between two limits, at most, to count as jumping between them."""
SHORTEST = 1.0
"""s that a jumping must last."""
LEAST_SWINGS = 10
WINDOWS = (1.5, 3.0, 6.0)
"""s; the longer ones are for slower oscillations."""
LEAST_CYCLES = 8
NARROW_SHARE = 0.6
"""Of the power in a window (without its trend) that lies at one frequency."""
STEADY_SHARE = 0.9
"""Least amplitude of a window's second half, as a share of the first half's: else it dies away."""
EVEN_SHARE = 0.7
"""Least amplitude of a quarter, as a share of the greatest: else it begins, or is stirred anew, in the
window."""
LASTING_SHARE = 0.7
"""Least amplitude at the end of a longer stretch, as a share of that at its beginning."""
COMMANDED_SHARE = 0.2
"""An amplitude of the command, as a share of the one found, from which the command explains it."""
LEAST_SPEED = 0.05
"""rad/s, amplitude; below it lie the steps of the encoders."""
LEAST_TORQUE_SHARE = 0.05
"""Amplitude as a share of the greatest desired torque, as much as a settled contact may be off."""
LEAST_CURRENT_SHARE = 0.1
"""Amplitude as a share of the limit."""
LEAST_TORQUE = 0.02
"""N·m, amplitude, where hardly anything is asked for."""
_BINS = 2
"""On each side of a peak: what a Hann window spreads of one frequency."""


Spans = list[tuple[float, float]]


@dataclass(frozen=True)
class Oscillation:
    """An oscillation of one stage. kind: "limits" (its current jumps between them), or the signal that shows
    it most: "velocity", "torque" (on the environment) or "current". frequency Hz. amplitude: half of peak to
    peak, in `unit`, the median over its time. start, end: s of the run's time. share_percent: of the run's
    whole time, without the pauses between `start` and `end`."""

    kind: str
    frequency: float
    amplitude: float
    unit: str
    start: float
    end: float
    share_percent: float


@dataclass(frozen=True)
class _Found:
    kind: str
    frequency: float
    amplitude: float
    unit: str
    spans: Spans

    @property
    def lasting(self) -> float:
        return sum(end - start for start, end in self.spans)


def find_oscillation(run: StageRun, unit: str = "A") -> Oscillation | None:
    """Return a stage's oscillation, of whatever signal shows it longest, or None; one between the limits of
    the current before all others. unit: of the current.
    """
    whole = float(run.time[-1] - run.time[0]) if len(run.time) else 0.0
    if len(run.time) < 16 or whole <= 0.0:
        return None
    current = run.commanded_current if run.commanded_current is not None else run.current
    asked, limit = float(np.nanmax(np.abs(run.desired_torque))), run.settings.current_limit
    torque = max(LEAST_TORQUE, LEAST_TORQUE_SHARE * asked)
    signals = (
        ("velocity", run.motor_velocity, "rad/s", LEAST_SPEED, run.settings.lambda_ or 0.0),
        ("torque", run.environment_torque, "N·m", torque, 1.0),
        ("current", current, unit, LEAST_CURRENT_SHARE * limit, asked / limit),
    )
    # The command tells best when the limit held; the measured current carries offset and noise.
    found = [_between_limits(run, current, limit, unit), *(_sustained(run, *signal) for signal in signals)]
    present = [one for one in found if one is not None]
    if not present:
        return None
    best = present[0] if present[0].kind == "limits" else max(present, key=lambda one: one.lasting)
    # Where a torque is held, the current reaches one limit only; the other signals show it there.
    spans = _joined(sorted(span for one in present for span in one.spans))
    share = 100.0 * sum(end - start for start, end in spans) / whole
    start, end = spans[0][0], spans[-1][1]
    return Oscillation(best.kind, best.frequency, best.amplitude, best.unit, start, end, min(100.0, share))


def _between_limits(run: StageRun, current: Array, limit: float, unit: str) -> _Found | None:
    if not (np.isfinite(limit) and limit > 0.0):
        return None
    at = np.flatnonzero(np.abs(current) >= AT_LIMIT * limit)
    sign = np.sign(current[at])
    swings = np.flatnonzero((sign[1:] != sign[:-1]) & (np.diff(run.time[at]) <= LONGEST_SWING))
    times = run.time[at[swings + 1]]
    spans, swung = [], 0
    for first, after in _runs(times, LONGEST_SWING):
        start, end = float(times[first]), float(times[after - 1])
        lasts = end - start >= SHORTEST and after - first >= LEAST_SWINGS
        if lasts and not _asked_for(run, start, end, after - first):
            spans.append((start, end))
            swung += after - first - 1
    if not spans:
        return None
    frequency = 0.5 * swung / sum(end - start for start, end in spans)
    return _Found("limits", frequency, limit, unit, spans)


def _runs(times: Array, gap: float) -> Iterator[tuple[int, int]]:
    """(first, after) of the stretches of `times` with no more than `gap` between neighbours."""
    if len(times):
        ends = np.flatnonzero(np.diff(times) > gap) + 1
        yield from zip([0, *ends.tolist()], [*ends.tolist(), len(times)], strict=True)


def _asked_for(run: StageRun, start: float, end: float, swings: int) -> bool:
    """Whether the desired torque changes its direction about as often as the current jumps."""
    inside = (run.time >= start) & (run.time <= end)
    asked = run.desired_torque[inside]
    asked = np.sign(asked - np.mean(asked))
    return int(np.count_nonzero(np.diff(asked[asked != 0.0]))) >= 0.5 * swings


def _sustained(
    run: StageRun, kind: str, signal: Array, unit: str, least: float, per_torque: float
) -> _Found | None:
    """per_torque: the factor by which the amplitude becomes one of torque, to be compared with the
    command's; 0 where nothing tells it: then any command of this frequency explains it."""
    period = float(np.median(np.diff(run.time)))
    # On uniform times: a sample that is missing would show as a jump at every frequency.
    time = np.arange(run.time[0], run.time[-1], period)
    values, asked = np.interp(time, run.time, signal), np.interp(time, run.time, run.desired_torque)
    seen: list[tuple[float, float, float, float]] = []
    for length in WINDOWS:
        count = round(length / period)
        for first in range(0, len(time) - count + 1, max(1, count // 4)):
            part = slice(first, first + count)
            peak = _steady_peak(values[part], period) if np.ptp(values[part]) >= least else None
            if peak is None or peak[1] < least:
                continue
            frequency, amplitude = peak
            if not _commanded(asked[part], period, frequency, amplitude * per_torque):
                seen.append((float(time[first]), float(time[first + count - 1]), frequency, amplitude))
    spans = [span for span in _joined(sorted((one[0], one[1]) for one in seen)) if not _fades(span, seen)]
    lasting = [one for one in seen if any(start <= one[0] and one[1] <= end for start, end in spans)]
    if not lasting:
        return None
    medians = np.median(np.array(lasting), axis=0)
    return _Found(kind, float(medians[2]), float(medians[3]), unit, spans)


def _fades(span: tuple[float, float], seen: list[tuple[float, float, float, float]]) -> bool:
    """Whether what was seen within `span`, as (start, end, frequency, amplitude), dies away towards its
    end."""
    inside = sorted(one for one in seen if span[0] <= one[0] and one[1] <= span[1])
    first, middle, last = (inside[k][3] for k in (0, len(inside) // 2, -1))
    # What only becomes smaller once, as when the arm meets a wall, and goes on so, lasts.
    return last < LASTING_SHARE * first and last < STEADY_SHARE * middle


def _steady_peak(values: Array, period: float) -> tuple[float, float] | None:
    """(frequency Hz, amplitude) of what makes up most of a window and does not fall within it, or None."""
    values = _without_trend(values)
    power = _power(values)
    lowest = LEAST_CYCLES  # bins are cycles in the window
    if len(power) <= lowest + _BINS:
        return None
    at = lowest + int(np.argmax(power[lowest:]))
    total = float(power.sum())
    # The lowest bin may be the slope of a peak below it, which a longer window sees.
    if total <= 0.0 or power[at - 1] > power[at]:
        return None
    if power[at - _BINS : at + _BINS + 1].sum() < NARROW_SHARE * total:
        return None
    frequency = _between_bins(power, at) / (len(values) * period)
    half = len(values) // 2
    first, second = (_amplitude(part, period, frequency) for part in (values[:half], values[half:]))
    quarters = [_amplitude(part, period, frequency) for part in np.array_split(values, 4)]
    if second < STEADY_SHARE * first or min(quarters) < EVEN_SHARE * max(quarters):
        return None
    return frequency, _amplitude(values, period, frequency)


def _commanded(asked: Array, period: float, frequency: float, torque: float) -> bool:
    """Whether the command explains an oscillation of `torque` N·m: it holds the same frequency, or it moves
    by more than that itself, as a command does that swings at another frequency (of which friction and walls
    make multiples, and which rings a joint again and again) or that steps."""
    asked = _without_trend(asked)
    same = _amplitude(asked, period, frequency)
    return same > COMMANDED_SHARE * torque + 1e-9 or float(np.sqrt(2.0) * np.std(asked)) > torque + 1e-9


def _without_trend(values: Array) -> Array:
    at = np.linspace(-1.0, 1.0, len(values))  # its mean is zero, so that the two parts do not mix
    return values - np.mean(values) - at * (at @ values / (at @ at))


def _power(values: Array) -> Array:
    spectrum = np.fft.rfft(values * np.hanning(len(values)))
    return np.abs(spectrum) ** 2


def _between_bins(power: Array, at: int) -> float:
    """The place of a peak between the bins, by a parabola through the logarithms of three."""
    if not 0 < at < len(power) - 1:
        return float(at)
    left, middle, right = np.log(np.maximum(power[at - 1 : at + 2], 1e-300))
    curvature = left - 2.0 * middle + right
    return at + (0.5 * float(left - right) / curvature if curvature < 0.0 else 0.0)


def _amplitude(values: Array, period: float, frequency: float) -> float:
    """Of the sine of that frequency in `values`, Hann-weighted."""
    weights = np.hanning(len(values))
    turning = np.exp(-2j * np.pi * frequency * period * np.arange(len(values)))
    return float(2.0 * np.abs(np.sum(weights * values * turning)) / np.sum(weights))


def _joined(spans: Spans) -> Spans:
    joined: Spans = []
    for start, end in spans:
        if joined and start <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(end, joined[-1][1]))
        else:
            joined.append((start, end))
    return joined
