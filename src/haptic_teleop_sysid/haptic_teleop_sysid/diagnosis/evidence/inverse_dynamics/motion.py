"""A recording in the band of its motion: angles, velocities, accelerations and input, filtered alike."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sysid.estimation.records import Record

from ...inputs.scales import bridged
from .block_means import block_means, response

FloatArray = NDArray[np.float64]

#: Order of the low-pass filter, which runs forward and backward: the phase is zero.
ORDER = 2
#: Samples kept per period of the cut-off.
KEPT_PER_PERIOD = 5.0
#: Samples per period of the cut-off in between, where torques are computed that are not smooth.
FINE_PER_PERIOD = 30.0
#: Periods of the cut-off by which a stretch is reflected at its ends before it is filtered.
PADDED = 3.0
#: Length of a hole, periods of the cut-off, up to which what is bridged is as good as read: a log that is
#: written three times as often as the encoder is read has a hole of two samples after each reading.
BRIDGED = 0.125
#: Periods of the cut-off at either end of a stretch that the filter's transient spoils.
ENDS = 1.0
#: Share of the top speed below which a joint stands still, and for how many periods of the cut-off: a motion
#: that turns is slow for less. Share of all samples that must be left for this to count.
STILL, STANDS, LEAST_MOVING = 0.02, 2.0, 0.05
#: The same for a shorter time, where its mean speed is a smaller share of that one: of a motion that turns it
#: is half.
HARDLY, BRIEFLY = 0.1, 1.0


@dataclass(frozen=True)
class BandedMotion:
    """One stretch of motion. All (n,), or (n, 2) for motor and arm (equal where the joint is rigid).

    ``angle`` rad, ``velocity`` rad/s, ``acceleration`` rad/s^2, filtered once; ``input``: A or N·m, filtered
    once, as it was at the times of the readings; so ``exogenous``, rad/s^2; ``time`` s; ``dt``: s, of all
    these, thinned to a rate at which a sign of the velocity is still a step; ``cutoff``: Hz; ``kept``:
    samples that count, every second one of the blocks of ``block`` samples, or all where ``block`` is 1;
    ``record``: as it came; ``thin``: its samples that remain; ``known``: for what follows from it and is
    asked for often.
    """

    angle: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    input: FloatArray
    exogenous: FloatArray
    time: FloatArray
    dt: float
    cutoff: float
    kept: NDArray[np.intp]
    block: int
    record: Record
    thin: slice
    known: dict[str, SimpleNamespace] = field(default_factory=dict, compare=False)

    def of_input(self, values: FloatArray) -> FloatArray:
        """What was held from each sample of the record to the next, (n,), as `input` has it."""
        return held_in_band(values, self.record.dt, self.cutoff)[self.thin]

    def while_held(self, values: FloatArray) -> FloatArray:
        """Smooth ``values`` (n,) in the middle between each sample of the record and the next: what an input,
        held from one to the other, meets."""
        middle = self.record.dt * (0.5 + np.arange(len(self.record), dtype=np.float64))
        return np.interp(self.record.start + middle, self.time, values)

    def filtered(self, values: FloatArray, times: int = 1) -> FloatArray:
        """``values`` (n, ...) through the filter of the band ``times`` more, at the samples that count.

        The input and what is linear in the angles, filtered already, go through it once more; a torque that
        is not linear in them (the sign of a velocity) goes through it twice: then all have met the same."""
        rows = block_means(values.reshape(len(values), -1), self.block, self.first)
        return self.of_blocks(rows, times).reshape(-1, *values.shape[1:])

    @property
    def first(self) -> int:
        """The sample around which the first block lies."""
        return int(self.kept[0]) % self.block if len(self.kept) else 0

    def of_blocks(self, means: FloatArray, times: int) -> FloatArray:
        """`filtered` of what `block_means` says around `first` and every ``block`` samples further on."""
        places = (self.kept - self.first) // self.block
        step = 2 if self.block > 1 else 1
        start = int(places[0]) % step if len(places) else 0
        found = low_passed(means, self.block * self.dt, self.cutoff, times, self.block, (start, step))
        return found.T.take((places - start) // step, axis=1).T  # row by row in memory: a few times faster


def low_passed(
    values: FloatArray,
    dt: float,
    cutoff: float,
    times: int = 1,
    block: int = 1,
    which: tuple[int, int] = (0, 1),
) -> FloatArray:
    """``values`` (n, ...) through a Butterworth low pass of ``cutoff``, Hz, forward and backward ``times``
    times: as its response in the frequency domain, on the values and their odd reflections at both ends.

    block: they are means (`block_means`) over blocks of so many samples, and get back what these took;
    which: of the result the sample from which on every sample is wanted, or every second one."""
    n = len(values)
    start, step = which
    rows = np.ascontiguousarray(values, dtype=np.float64).reshape(n, -1)
    pad = min(n - 1, round(PADDED / (cutoff * dt)))
    pad -= (pad + start) % step
    length = step * scipy.fft.next_fast_len(-(-(n + 2 * pad) // step), real=True)
    spectrum = np.asarray(scipy.fft.rfft(_reflected(rows, pad, length), overwrite_x=True))
    spectrum *= _response(length, round(cutoff * dt, 15), times, block)
    if step == 2:
        spectrum = _of_every_second(spectrum, length)
    found = np.asarray(scipy.fft.irfft(spectrum, length // step, overwrite_x=True))
    first = (pad + start) // step
    return found[:, first : first + -(-(n - start) // step)].T.reshape(-1, *values.shape[1:])


def _of_every_second(spectrum: NDArray[np.complex128], length: int) -> NDArray[np.complex128]:
    """Spectrum (columns, length // 4 + 1) of every second one of ``length`` real samples, which is even, from
    theirs (columns, length // 2 + 1): what lies above half of it folds, and nothing is left out."""
    number = length // 4 + 1
    return 0.5 * (spectrum[:, :number] + spectrum[:, ::-1][:, :number].conj())


@njit(cache=True, nogil=True, error_model="numpy")
def _reflected(values: FloatArray, pad: int, length: int) -> FloatArray:
    """Columns of ``values`` (n, columns) as rows (columns, length), with ``pad`` samples turned about either
    end before and behind them, and zeros after that."""
    n, columns = values.shape
    found = np.zeros((columns, length))
    for c in range(columns):
        for k in range(n):
            found[c, pad + k] = values[k, c]
        for k in range(pad):
            found[c, k] = 2.0 * values[0, c] - values[pad - k, c]
            found[c, pad + n + k] = 2.0 * values[n - 1, c] - values[n - 2 - k, c]
    return found


@lru_cache(maxsize=64)
def _response(length: int, cutoff: float, times: int, block: int) -> FloatArray:
    """Response of the low pass forward and backward ``times`` times at the frequencies of ``length`` samples;
    ``cutoff``: cycles per sample. It is the one of the samples in the blocks: both rates meet one filter."""
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(length), dtype=np.float64)
    warped = np.tan(np.pi / block * np.minimum(frequency, 0.4999)) / np.tan(np.pi / block * cutoff)
    return (1.0 / (1.0 + warped ** (2 * ORDER))) ** times / response(frequency, block)


def banded(record: Record, rigid: bool, cutoff: float) -> BandedMotion:
    """The record in the band; readings that are missing are bridged and do not count, nor does a joint that
    stands still."""
    measured = record.measured
    arm = measured[:, 0] if rigid or not np.any(np.isfinite(measured[:, 1])) else measured[:, 1]
    raw = np.column_stack([bridged(measured[:, 0]), bridged(arm)])
    angle = low_passed(raw, record.dt, cutoff)
    velocity = np.gradient(angle, record.dt, axis=0)
    thin = slice(None, None, max(1, int(1.0 / (FINE_PER_PERIOD * cutoff * record.dt))))
    dt = record.dt * (thin.step or 1)
    missing = in_long_runs(~np.isfinite(measured[:, 0]) | ~np.isfinite(arm), BRIDGED / (cutoff * record.dt))
    missing |= standing(velocity, 1.0 / (cutoff * record.dt))
    block, kept = _counting(missing, thin, dt, cutoff)
    time = record.start + record.dt * np.arange(len(record), dtype=np.float64)[thin]
    return BandedMotion(
        angle[thin],
        velocity[thin],
        np.gradient(velocity, record.dt, axis=0)[thin],
        held_in_band(record.input, record.dt, cutoff)[thin],
        held_in_band(record.exogenous, record.dt, cutoff)[thin],
        time,
        dt,
        cutoff,
        kept,
        block,
        record,
        thin,
    )


def held_in_band(values: FloatArray, dt: float, cutoff: float) -> FloatArray:
    """Values (n,) that are held from each sample to the next, in the band: at the sample itself such a value
    is the mean of before and after."""
    return low_passed(0.5 * (values + np.append(values[:1], values[:-1])), dt, cutoff)


def in_long_runs(marked: NDArray[np.bool_], most: float) -> NDArray[np.bool_]:
    """Which of the samples (n,) that are ``marked`` lie in a row of more than ``most`` of them."""
    found = np.zeros(len(marked), dtype=np.bool_)
    for start, stop in _runs(marked):
        found[start:stop] = stop - start > most
    return found


def _runs(marked: NDArray[np.bool_]) -> list[list[int]]:
    """First and one past the last of each row of samples (n,) that are ``marked``."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked.astype(np.int8), [0]])))
    return edges.reshape(-1, 2).tolist()


def standing(velocity: FloatArray, period: float) -> NDArray[np.bool_]:
    """Which of the samples of a ``velocity`` (n, 2) lie where the joint stands still, for STANDS times
    ``period`` samples, or BRIEFLY where it hardly moves at all: dry friction then holds whatever torque there
    is, up to its own, and no balance tells it."""
    speed = np.max(np.abs(velocity), axis=1)
    slow = STILL * np.max(speed, initial=0.0)
    found = np.zeros(len(speed), dtype=np.bool_)
    for start, stop in _runs(speed < slow):
        hardly = float(np.mean(speed[start:stop])) < HARDLY * slow
        found[start:stop] = stop - start > (BRIEFLY if hardly else STANDS) * period
    return found if np.mean(found) <= 1.0 - LEAST_MOVING else np.zeros(len(found), dtype=np.bool_)


def _counting(
    missing: NDArray[np.bool_], thin: slice, dt: float, cutoff: float
) -> tuple[int, NDArray[np.intp]]:
    """Samples in a block, and of the thinned samples those that count: not at the ends, and not where
    readings near by are missing."""
    number = len(missing[thin])
    end = min(round(ENDS / (cutoff * dt)), number // 10)
    # Two blocks to a sample that counts: what is left at the blocks' rate cannot fold into the band.
    block = max(1, int(0.5 / (KEPT_PER_PERIOD * cutoff * dt)))
    step = 2 * block if block > 1 else max(1, int(1.0 / (KEPT_PER_PERIOD * cutoff * dt)))
    kept = np.arange(end, number - end, step)
    if np.any(missing):
        reach = max(1, round(0.5 * (thin.step or 1) / (cutoff * dt)))
        near = np.convolve(missing, np.ones(2 * reach + 1), "same")[thin] > 0.25 * reach
        kept = kept[~near[kept]]
    return block, kept
