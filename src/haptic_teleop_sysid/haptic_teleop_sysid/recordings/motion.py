"""Position and velocity of one joint on the grid of a data set, without readings that cannot be true."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_control.robots import VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING
from haptic_teleop_sysid.recordings.channels import Channel
from haptic_teleop_sysid.recordings.damage import SETTLES, held, leaps, stood_still
from haptic_teleop_sysid.recordings.seldom_read import seldom_read
from haptic_teleop_sysid.recordings.slips import MOST, Slip, excursions, put_back, slips
from haptic_teleop_sysid.recordings.time_grid import NS, TimeGrid
from haptic_teleop_sysid.recordings.velocity_series import velocity_series

Array = NDArray[np.float64]


@dataclass
class Damage:
    """What is wrong with the readings of a recording: `told` in sentences, and the encoders' `slips`."""

    told: list[str] = field(default_factory=list)
    slips: list[Slip] = field(default_factory=list)


def motion(
    channel: Channel, grid: TimeGrid, robot: str, valid: NDArray[np.bool_], damage: Damage
) -> tuple[Array, Array]:
    """Position and velocity (n,) of a channel on the grid. Samples that were not read are bridged and marked
    as not `valid` (n,), what slipped is put back; `damage` is told."""
    read = channel.values("position")
    mended = without_wrong_readings(read, channel.joint, grid, damage)
    position = finite(grid.sampled(mended), valid)
    if not np.any(np.isfinite(position)):
        return position, position  # nobody read it: the caller says what follows
    recorded = channel.values_or_none("velocity")
    # The driver made its velocity of wrong readings, too.
    if mended is read and recorded is not None and np.mean(np.isfinite(recorded)) > 0.5:
        return position, finite(grid.sampled(recorded), valid)
    if robot == "generic":
        return position, derivative(position, 11, 1, grid.dt)
    return position, velocity_series(position, grid.dt, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING)


def without_wrong_readings(read: Array, joint: str, grid: TimeGrid, damage: Damage) -> Array:
    """The positions of all messages (m,) without what cannot be true; `read` itself where all of it can."""
    kept = np.where(np.isfinite(read[grid.keep]), read[grid.keep], np.nan)
    unread = leaps(kept)
    if unread.any():
        damage.told.append(
            f"{joint}.position leaps away and back at {counted(int(np.sum(unread)), 'sample')}, which "
            "no joint does: "
            "they count as not read"
        )
    known = np.where(unread, np.nan, kept)
    stale = held(known) | seldom_read(known)
    if stale.any():
        damage.told.append(
            f"{joint}.position repeats one value at {counted(int(np.sum(stale)), 'sample')} while the "
            "joint moves on: "
            "they count as not read"
        )
    unread |= stale
    found: list[Slip] = []
    if np.any(np.isfinite(kept) & ~unread):
        way = finite(np.where(unread, np.nan, kept), None)
        apart = np.diff(grid.keep, prepend=grid.keep[0] - 1) > 1  # messages between were left out
        away, found = excursions(slips(way, (grid.stamps - grid.stamps[0]) * NS, apart))
        for start, stop in away:
            unread[start:stop] = True
        if away:
            damage.told.append(
                f"{joint}.position is elsewhere for some samples {counted(len(away), 'time')} and comes "
                "back: they "
                "count as not read"
            )
    if len(found) > MOST:
        damage.told.append(
            f"{joint}.position jumps elsewhere {len(found)} times, too often for an encoder that slips now "
            "and then: its readings were left as they are and should not be trusted"
        )
        found = []
    for slip in found:
        time = float((grid.stamps[slip.index] - grid.stamps[0]) * NS)
        damage.slips.append(replace(slip, encoder=joint, time=time))
        damage.told.append(
            f"{joint}.position is {slip.size:.4g} rad elsewhere from {time:.3f} s on and goes on from there, "
            "as of an encoder that slips or loses counts: it was put back"
        )
    if not unread.any() and not found:
        return read
    mended = read.copy()
    mended[grid.keep] = put_back(np.where(unread, np.nan, kept), found)
    return mended


def leave_out_stills(
    positions: dict[str, Array],
    steps: dict[str, float],
    dt: float,
    valid: NDArray[np.bool_],
    damage: Damage,
) -> None:
    """Mark where one of the two encoders of a joint (joint -> position (n,), and the encoder's step, rad)
    surely stood still while the other moved on, and tell where it may have."""
    for joint, other in (list(positions), list(positions)[::-1]):
        values = positions[joint]
        found = stood_still(values, positions[other], dt, steps[joint])
        for start, stop, sure in found:
            if sure:
                valid[start : stop + round(SETTLES / dt)] = False
        if found:
            start, stop, sure = max(found, key=lambda s: (s[2], s[1] - s[0]))
            why = "its encoder or the line to it failed" + ("" if sure else ", or it was held")
            damage.told.append(
                f"{joint}.position stands still {counted(len(found), 'time')} while {other} moves on, "
                f"{(stop - start) * dt:.3f} s from {start * dt:.3f} s: {why}"
            )


def finite(values: Array, valid: NDArray[np.bool_] | None) -> Array:
    """Bridge values that are not finite; the samples are marked as not valid."""
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    if valid is not None:
        valid &= good
    index = np.arange(len(values))
    return np.interp(index, index[good], values[good])


def derivative(values: Array, samples: int, order: int, dt: float) -> Array:
    """Derivative of a cubic through about `samples` neighbours of each sample, without delay."""
    length = min(max(5, samples // 2 * 2 + 1), (len(values) - 1) // 2 * 2 + 1)
    return np.asarray(scipy.signal.savgol_filter(values, length, 3, deriv=order, delta=dt), dtype=np.float64)
