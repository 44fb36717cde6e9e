"""Readings that no joint can have made: they leap away and back within some samples, or stand still while the
other encoder of the joint moves; and stretches without readings that are too long to bridge."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sysid.recordings.slips import SLOWEST
from haptic_teleop_sysid.recordings.time_grid import GAP_PERIODS

Array = NDArray[np.float64]
LEAP = 12.0
"""Factor over the fastest usual step of a signal from one sample to the next that no motion exceeds ..."""
USUAL = 0.995
"""... which is the largest of this share of all steps."""
LONGEST_LEAP = 5
"""Samples after which a value that has leapt away is no outlier but another place."""
STANDS_STILL = 0.1
"""s without a single step of the encoder from which one may ask whether it stands still ..."""
FURTHER = 4.0
"""... and factor over what motor and arm differ by at other times, by which the other one then turns on."""
LEAPS_OUT = 3.0
"""Factor over the steps behind, by which an encoder that failed leaps to where the joint had got to."""
MOVES = 4.0
"""Steps of the encoder per sample, of a joint that cannot stand still for just one of them."""
LONGEST_HELD = 50
"""Repeated readings after which the speed before them says nothing any more."""
CATCHES_UP = 1.6
"""Factor over the speed behind repeated readings by which the step out of them catches up ..."""
CAUGHT_UP = 0.5
"""... and share of what the speeds before and behind make of their time that it comes to, or the inverse."""
EVEN = 0.6
"""Share of the mean by which the speeds on either side may differ from it."""
OFF = 12.0
"""Factor over the steps on either side by which a value lies off the way."""
_ROUND = 4
"""New values (or samples) on either side from which the speed there is drawn."""
SETTLES = 0.05
"""s that filtered velocities take to forget how a reading jumped to where the joint had got to."""


def leaps(values: Array) -> NDArray[np.bool_]:
    """True (n,) at samples of a position (n,) that leave its motion: reached by a step of more than LEAP
    times the usual ones and left by one back, within LONGEST_LEAP samples. Usual are those of a joint that
    moves: samples that repeat the one before do not count."""
    found = np.zeros(len(values), dtype=np.bool_)
    steps = np.diff(values)
    known = np.abs(steps[np.isfinite(steps)])
    known = known[known > 1e-12]
    if len(known) < 100:
        return found
    limit = LEAP * float(np.quantile(known, USUAL))
    away = np.flatnonzero(np.abs(steps) > limit)
    i = 0
    while i < len(away) - 1:
        start, stop = away[i], away[i + 1]
        back = np.sign(steps[start]) != np.sign(steps[stop])
        if back and stop - start <= LONGEST_LEAP and abs(values[stop + 1] - values[start]) < 0.5 * limit:
            found[start + 1 : stop + 1] = True
            i += 2
        else:
            i += 1
    return found


def held(values: Array) -> NDArray[np.bool_]:
    """True (n,) at readings of a position (n,) that repeat one before although the joint moves on, which the
    next new one has caught up with; and at one value told over and over that lies off the way before and
    behind it. Up to LONGEST_HELD samples; longer ones are for `stood_still`."""
    found = np.zeros(len(values), dtype=np.bool_)
    steps = np.diff(values)
    least = MOVES * encoder_step(values)
    if least == 0.0:
        return found
    new = np.flatnonzero(steps != 0.0) + 1  # samples at which a new value begins
    # From one new value to the next: other repeats nearby, which the next value has caught up with, are even.
    speeds = np.diff(values[new]) / np.diff(new)
    if len(speeds) < 2 * _ROUND:
        return found
    k = np.arange(_ROUND, len(speeds) - _ROUND + 1)
    k = k[(new[k + 1] - new[k] >= 2) & (new[k + 1] - new[k] <= LONGEST_HELD)]
    first, stop = new[k], new[k + 1]
    into, out = steps[first - 1], steps[stop - 1]
    ahead = sliding_window_view(speeds, _ROUND)[k - _ROUND]
    after = sliding_window_view(speeds, _ROUND - 1)[k + 1]
    before, behind = np.mean(ahead[:, :-1], axis=1), np.mean(after, axis=1)
    # As no motion by single steps of an encoder is, whose readings repeat by themselves.
    even = _even(ahead) & _even(after)
    expected = np.abs((stop - first) * 0.5 * (before + behind))
    caught = np.sign(before + behind) * out
    repeats = (
        even
        & (np.minimum(np.minimum(np.abs(into), np.abs(before)), np.abs(out)) > least)
        & (np.abs(out) > CATCHES_UP * np.abs(behind))
        & (CAUGHT_UP * expected < caught)
        & (caught < expected / CAUGHT_UP)
    )
    leap = np.minimum(np.abs(into), np.abs(out))
    usual = np.maximum(np.maximum(np.abs(before), np.abs(behind)), least)
    off = ~repeats & (leap > OFF * usual) & (np.abs(values[stop] - values[first - 1]) < 0.5 * leap)
    for i in np.flatnonzero(repeats | off):
        found[first[i] + int(repeats[i]) : stop[i]] = True
    return found


def _even(speeds: Array) -> NDArray[np.bool_]:
    """Whether the speeds (n, m) of each row differ little from their mean."""
    mean = np.mean(speeds, axis=1)
    return np.max(np.abs(speeds - mean[:, None]), axis=1) < EVEN * np.abs(mean)


def encoder_step(read: Array, fewest: int = 1) -> float:
    """The least step between readings (m,) of a position, rad: the encoder's. 0 where fewer than ``fewest``
    differ. To be asked of what was read; at other times, between readings, single steps come in parts."""
    steps = np.abs(np.diff(read[np.isfinite(read)]))
    steps = steps[steps > 1e-12]
    return float(np.min(steps)) if len(steps) >= fewest else 0.0


def stood_still(values: Array, other: Array, dt: float, step: float) -> list[tuple[int, int, bool]]:
    """Stretches [start, stop) of a position (n,) that does not change by a single step of its encoder
    (``step``, rad: `encoder_step`), for at least STANDS_STILL s, while the joint's `other` position (n,)
    moves on: surely (True) where it leaps to where it had got to in the end, unless samples are so far apart
    (SLOWEST) that the joint may have moved meanwhile; or perhaps, where the other one turns further than
    FURTHER times all that the two differ by at other times, which a joint does that is held on one side."""
    steps = np.append(np.abs(np.diff(values)), 0.0)
    changes = np.flatnonzero(steps > 1e-12) + 1
    edges = np.concatenate([[0], changes, [len(values)]])
    longest = round(STANDS_STILL / dt)
    still = [(int(a), int(b)) for a, b in pairwise(edges) if b - a > longest]
    if not still:
        return []
    moving = np.ones(len(values), dtype=np.bool_)
    for a, b in still:
        moving[a:b] = False
    if np.sum(moving) < 10:
        return []
    least = MOVES * step
    far = FURTHER * max(float(np.ptp((other - values)[moving])), least)
    found = []
    for a, b in still:
        moved = float(np.ptp(other[a:b]))
        # Over two samples: one that lies between two readings has but a part of the leap.
        out = abs(float(values[min(b + 1, len(values) - 1)] - values[b - 1]))
        # What is let go begins slowly: its first steps are no larger than the next ones.
        sure = out > LEAPS_OUT * max(float(np.max(steps[b + 1 : b + _ROUND], initial=0.0)), least)
        sure = sure and dt <= SLOWEST and moved > 0.5 * out
        if sure or moved > far:
            found.append((a, b, bool(sure)))
    return found


def refuse_holes(valid: NDArray[np.bool_], dt: float, name: str, why: list[str]) -> None:
    """Raise RecordingError where more than GAP_PERIODS samples in a row are not `valid` (n,); `why` says what
    is known of them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], valid, [True]]).astype(np.int8)))
    stretches = edges.reshape(-1, 2)
    long = stretches[np.diff(stretches, axis=1)[:, 0] > GAP_PERIODS]
    if not len(long):
        return
    first, stop = max(long.tolist(), key=lambda s: s[1] - s[0])
    raise RecordingError(
        f"{name} has {counted(len(long), 'stretch', 'stretches')} of more than {GAP_PERIODS:g} samples "
        "without a usable reading, "
        f"the longest of {(stop - first) * dt:.3f} s at {first * dt:.3f} s"
        + (f" ({'; '.join(why)})" if why else "")
        + ": record again, or say --allow-gaps to leave them out."
    )
