"""The band of a motion: up to which frequency recorded angles move, and where noise begins."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sysid.estimation.likelihood import FEWEST_READINGS
from haptic_teleop_sysid.estimation.records import Record

from ...inputs.scales import bridged

FloatArray = NDArray[np.float64]

#: Share of the velocity's power that lies below the band of the motion, and the cut-off relative to that.
POWER, ABOVE = 0.95, 4.0
#: Factor over the median of a spectrum about it from which a line stands out.
STANDS_OUT = 30.0
#: Octaves about a frequency: a motor that cogs at varying speed has a hump of one.
_ABOUT, _PLACES = 3.0, 96
#: Lowest and highest cut-off: cycles over a stretch that counts, and share of the rate of the readings.
LEAST_CYCLES, MOST_OF_RATE = 5.0, 0.1
#: s, length of the stretches whose spectra are averaged.
SEGMENT = 8.0


def motion_band(records: Sequence[Record]) -> float:
    """Cut-off, Hz, that leaves the motion and takes the noise: ABOVE times the frequency below which POWER of
    the motor's velocity lies, over all recordings, up to the `_valley` behind which the readings' scatter
    rises: the velocity of a coarse encoder has most of its power where nothing moves. What stands out behind
    it by more than the encoder's steps is motion, too (`_lines`). Half of the samples lie in stretches of
    LEAST_CYCLES of it at least: a short one between two holes says nothing of the band. No higher than
    `highest_cutoff`."""
    lengths = sorted((len(r) * r.dt for r in records), reverse=True)
    shortest = lengths[int(np.searchsorted(np.cumsum(lengths), 0.5 * sum(lengths)))]
    grid = np.linspace(0.0, 0.5 / max(r.dt for r in records), 4096)
    spectrum = np.zeros(len(grid))
    for record in records:
        speed = np.diff(bridged(record.measured[:, 0])) / record.dt
        length = min(round(SEGMENT / record.dt), round(shortest / record.dt), len(speed))
        found = scipy.signal.welch(speed - np.mean(speed), 1.0 / record.dt, nperseg=length)
        spectrum += np.interp(grid, *found) * len(record) * record.dt
    spectrum /= sum(len(r) * r.dt for r in records)
    counts = np.arange(len(grid)) < _valley(grid, spectrum, LEAST_CYCLES / shortest)
    counts |= _lines(grid, spectrum, ~counts, max(r.resolution[0] for r in records))
    total = np.cumsum(spectrum * counts)
    edge = float(grid[np.searchsorted(total, POWER * total[-1])])
    return float(np.clip(ABOVE * edge, LEAST_CYCLES / shortest, highest_cutoff(records)))


def highest_cutoff(records: Sequence[Record]) -> float:
    """MOST_OF_RATE of the `rate_of_readings`, Hz."""
    return MOST_OF_RATE * rate_of_readings(records)


def rate_of_readings(records: Sequence[Record]) -> float:
    """Readings per second, Hz, over all records, of the encoder that is read least often, of those that are
    read at all; no more than the slowest record has samples. A log may be written faster than an encoder is
    read."""
    rates = [1.0 / max(r.dt for r in records)]
    for channel in (0, 1):
        read = [r for r in records if r.readings[channel] >= FEWEST_READINGS]
        if any(r.readings[channel] < len(r) for r in read):
            rates.append(sum(r.readings[channel] for r in read) / sum(len(r) * r.dt for r in read))
    return float(min(rates))


def _valley(frequency: FloatArray, power: FloatArray, lowest: float) -> int:
    """Place of the end of the octave, from ``lowest`` up, in which a spectrum (n,) has least on average."""
    edges = [lowest]
    while 2.0 * edges[-1] < frequency[-1]:
        edges.append(2.0 * edges[-1])
    places = [*np.searchsorted(frequency, edges).tolist(), len(frequency)]
    octaves = [(float(np.mean(power[a:b])), b) for a, b in pairwise(places) if b > a]
    return min(octaves)[1] if octaves else len(frequency)


def _lines(
    frequency: FloatArray, power: FloatArray, behind: NDArray[np.bool_], step: float
) -> NDArray[np.bool_]:
    """Where, among the places ``behind`` the valley of a velocity's spectrum, the angle moves: it stands out
    there by STANDS_OUT over the median about it, and moves by more than a ``step`` of the encoder, rms.
    Readings that are rounded scatter by less than a third of a step in all; those that scatter the more the
    slower it is have no line."""
    angle = np.zeros(len(frequency))
    angle[behind] = power[behind] / (2.0 * np.pi * frequency[behind]) ** 2
    found = behind & (angle > STANDS_OUT * _about(frequency, angle, behind))
    moved = math.sqrt(float(np.sum(angle[found])) * (frequency[1] - frequency[0]))
    return found if moved > step else np.zeros(len(found), dtype=np.bool_)


def _about(frequency: FloatArray, values: FloatArray, there: NDArray[np.bool_]) -> FloatArray:
    """Median (n,) of values over _ABOUT octaves about each frequency, of the places that are ``there``."""
    at, own = frequency[there], values[there]
    if not len(at):
        return np.zeros(len(frequency))
    centres = np.geomspace(at[0], at[-1], max(round(6.0 * math.log2(at[-1] / at[0])), 2))
    reach = 2.0 ** (0.5 * _ABOUT)
    # Places at equal steps of the logarithm: as many below a frequency as above it.
    about = np.clip(np.outer(centres, np.geomspace(1.0 / reach, reach, _PLACES)), at[0], at[-1])
    medians = np.median(own[np.clip(np.searchsorted(at, about), 0, len(own) - 1)], axis=1)
    return np.interp(frequency, centres, medians)


def long_enough(records: Sequence[Record], cutoff: float) -> list[Record]:
    """The records that last LEAST_CYCLES of the cut-off; of shorter ones a filter sees little but the
    ends."""
    least = 0.99 * min(LEAST_CYCLES / cutoff, max(len(r) * r.dt for r in records))
    return [r for r in records if len(r) * r.dt >= least]
