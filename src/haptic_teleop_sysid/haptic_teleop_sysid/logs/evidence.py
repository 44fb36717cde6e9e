"""How signals go together: a velocity is the derivative of its position, a factor between the two may be one
between units, and an input drives the joint or brakes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sysid.recordings.median_frequency import median_periods

Array = NDArray[np.float64]
_DEGREES = 180.0 / np.pi
#: Factors that units differ by: what is so many times too large, and what it then is.
FACTORS = {
    _DEGREES: "degrees taken for radians",
    2.0 * np.pi: "radians taken for turns, or hertz for rad/s",
    60.0 / (2.0 * np.pi): "turns per minute taken for rad/s",
    360.0: "degrees taken for turns",
    6.0: "degrees per second taken for turns per minute",
    60.0: "a time per minute taken for one per second",
    1000.0: "a thousandth taken for the whole unit (mm, ms, mrad)",
    100.0: "a hundredth taken for the whole unit (cm)",
    1e6: "a millionth taken for the whole unit (us, um)",
    25.4: "millimetres taken for inches",
}
#: How near a measured factor must come, and how well two signals must go together for it to count.
NEAR, ALIKE = 0.02, 0.95
#: Power, relative to the rms of input and velocity, below which the input brakes.
BRAKES = -0.1
#: The same from which it brakes, whenever it acts. By hand: 0.2 is the most by which an input of the right
#: sign seems to brake, in both halves of one of 116 recordings; a late thrust moves that joint.
BRAKES_HARD = -0.3
#: Share of a period of the motion by which the input may act later, and how many times within it are tried.
LATER, _LATE_STEPS = 0.125, 4


@dataclass(frozen=True)
class Relation:
    """How one signal goes with another: ``ratio`` of the first to what the second makes of it, ``alike``:
    correlation between the two, -1 to 1."""

    ratio: float
    alike: float


def derivative_relation(time: Array, position: Array, velocity: Array) -> Relation | None:
    """Relation of a position (n,) to the integral of a velocity (n,), both without their trend; None where
    either hardly moves or there are too few samples. A step back in time counts for neither: nobody knows how
    long it took."""
    good = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(time)
    good[1:] &= np.diff(time) != 0.0
    if np.sum(good) < 20:
        return None
    t, p, v = time[good], position[good], velocity[good]
    steps = np.diff(t)
    forward = steps > 0.0
    way = np.cumsum(np.where(forward, 0.5 * (v[1:] + v[:-1]) * steps, 0.0))
    moved = np.cumsum(np.where(forward, np.diff(p), 0.0))
    return relation(np.r_[p[0], p[0] + moved], np.r_[0.0, way])


def relation(one: Array, other: Array) -> Relation | None:
    """Relation of two signals (n,) without their trends."""
    good = np.isfinite(one) & np.isfinite(other)
    if np.sum(good) < 20:
        return None
    a, b = scipy.signal.detrend(one[good]), scipy.signal.detrend(other[good])
    spread = float(np.std(a)), float(np.std(b))
    if min(spread) <= 1e-9 * max(float(np.max(np.abs(one[good]))), 1e-300) or min(spread) <= 0.0:
        return None
    alike = float(np.mean(a * b) / (spread[0] * spread[1]))
    return Relation(spread[0] / spread[1] * np.sign(alike), alike)


def still(values: Array) -> bool:
    """Whether a signal (n,) has one value alone, or none."""
    good = values[np.isfinite(values)]
    return len(good) == 0 or bool(np.all(good == good[0]))


def known_factor(ratio: float) -> tuple[float, str] | None:
    """(factor above one, what it is between) that a ratio, or one over it, comes near to; None for none."""
    size = abs(ratio) if abs(ratio) > 1.0 else 1.0 / max(abs(ratio), 1e-300)
    for factor, what in FACTORS.items():
        if abs(size / factor - 1.0) < NEAR:
            return factor, what
    return None


def speed_of(position: Array | None, velocity: Array | None, jumps: bool) -> Array | None:
    """The velocity (n,), in any unit, that tells in which direction a joint moves: the position's change,
    because a recorded velocity may have been filtered and be late, unless the position ``jumps`` by whole
    turns; None where there is neither."""
    if position is not None and len(position) > 1 and not (jumps and velocity is not None):
        return np.gradient(position)
    return velocity


def brakes(drive: Array, velocity: Array) -> bool:
    """Whether an input (n,) takes energy out of a joint of this velocity (n,), clearly and in both halves.

    Where it does so by little, it must do so if it acted later, too, by up to LATER periods of the motion: a
    controller has braked a mass before a thrust does that takes time. An input of the opposite sign that a
    mass follows brakes all the same; one that mostly holds a spring is not found then."""
    good = np.isfinite(drive) & np.isfinite(velocity)
    if np.sum(good) < 40:
        return False
    u, v = drive[good], velocity[good]
    scale = float(np.sqrt(np.mean(u**2) * np.mean(v**2)))
    half, latest = len(u) // 2, int(LATER * (len(v) / max(median_periods(v), 1)))

    def weakest(late: int) -> float:
        """Power of the half in which it takes less, relative to the rms of both."""
        parts = slice(half), slice(half, 2 * half)
        return max(float(np.mean(u[s][: half - late] * v[s][late:half])) for s in parts) / scale

    if not scale > 0.0:
        return False
    lates = (latest * step // _LATE_STEPS for step in range(_LATE_STEPS + 1))
    return weakest(0) < BRAKES_HARD or all(weakest(late) < BRAKES for late in lates)
