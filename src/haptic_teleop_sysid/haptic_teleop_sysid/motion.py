"""Position and velocity of one joint on the grid of a data set, without readings that cannot be true."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from haptic_teleop_control.robots import VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING
from haptic_teleop_sysid.channels import Channel
from haptic_teleop_sysid.damage import SETTLES, leaps, stood_still
from haptic_teleop_sysid.time_grid import TimeGrid
from haptic_teleop_sysid.velocity_series import velocity_series

Array = NDArray[np.float64]


def motion(
    channel: Channel, grid: TimeGrid, robot: str, valid: NDArray[np.bool_], damage: list[str]
) -> tuple[Array, Array]:
    """Position and velocity (n,) of a channel on the grid. Samples that were not read are bridged and marked
    as not `valid` (n,); `damage` gets a sentence about outliers."""
    read = channel.values("position")
    outliers = leaps(read[grid.keep])
    if outliers.any():
        read = read.copy()
        read[grid.keep[outliers]] = np.nan
        damage.append(
            f"{channel.joint}.position leaps away and back at {int(np.sum(outliers))} samples, "
            "which no joint does: they count as not read"
        )
    position = finite(grid.sampled(read), valid)
    recorded = channel.values_or_none("velocity")
    # The driver made its velocity of the outliers, too.
    if not outliers.any() and recorded is not None and np.mean(np.isfinite(recorded)) > 0.5:
        return position, finite(grid.sampled(recorded), valid)
    if robot == "generic":
        return position, derivative(position, 11, 1, grid.dt)
    return position, velocity_series(position, grid.dt, VELOCITY_FILTER_CUTOFF_HZ, VELOCITY_FILTER_DAMPING)


def leave_out_stills(
    positions: dict[str, Array], dt: float, valid: NDArray[np.bool_], damage: list[str]
) -> None:
    """Mark where one of the two encoders of a joint stood still while the other moved on."""
    for joint, other in (list(positions), list(positions)[::-1]):
        values = positions[joint]
        found = stood_still(values, positions[other], dt)
        for start, stop in found:
            valid[start : stop + round(SETTLES / dt)] = False
        if found:
            start, stop = max(found, key=lambda s: s[1] - s[0])
            damage.append(
                f"{joint}.position stands still {len(found)} times while {other} moves on, "
                f"{(stop - start) * dt:.3f} s from {start * dt:.3f} s: its encoder or the line to it failed"
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
    return np.asarray(savgol_filter(values, length, 3, deriv=order, delta=dt), dtype=np.float64)
