"""Derivatives of an angle in the band in which it moves.

A polynomial through neighbours takes a part of what it differentiates: of an acceleration at 5 Hz a cubic
over 60 ms loses 5 %, and a coupling found with it is as much too large. A low pass loses nothing below its
cut-off, and that is put where the angle's spectrum sinks into the scatter of its readings.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Most samples of the stretches whose spectra are averaged, and how many of them a recording has at least: of
#: one stretch alone a line of noise may stand out.
SEGMENT, STRETCHES = 2048, 4
#: Factor over the scatter of the readings from which a line is motion, the cut-off relative to the highest
#: such line, and the order of the low pass, which runs forward and backward.
MOVES, ABOVE, ORDER = 10.0, 1.5, 8
#: Highest cut-off as a share of the sampling rate.
MOST = 0.45


def banded_derivative(values: Array, order: int, dt: float) -> Array:
    """The ``order``-th derivative (0 to 2) of an angle (n,) sampled every ``dt`` s, without delay, (n,), in
    the angle's unit per s^order. Of fewer samples than the low pass needs, plain differences; of one, 0."""
    if len(values) < 2:
        return np.array(values, dtype=np.float64) if order == 0 else np.zeros(len(values))
    cutoff = moving_band(values, dt)
    found = np.array(values, dtype=np.float64)
    padding = round(3.0 / (cutoff * dt))
    if padding < len(values) - 1:
        low_pass = scipy.signal.butter(ORDER, cutoff, fs=1.0 / dt, output="sos")
        found = np.asarray(scipy.signal.sosfiltfilt(low_pass, found, padlen=padding), dtype=np.float64)
    for _ in range(order):
        found = np.gradient(found, dt)
    return found


def to_the_next(values: Array) -> Array:
    """Means (n,) of what is read at samples (n,) from each to the next: what acts as long as a sample is held
    would else be half of one late."""
    return 0.5 * (values + np.append(values[1:], values[-1:]))


def moving_band(values: Array, dt: float) -> float:
    """Cut-off, Hz, below which all lies by which an angle (n,) moves: the scatter of its readings is the
    median of the upper half of its spectrum."""
    length = min(SEGMENT, max(len(values) // STRETCHES, min(len(values), 16)))
    frequency, power = scipy.signal.welch(values - np.mean(values), 1.0 / dt, nperseg=length)
    scatter = float(np.median(power[len(power) // 2 :]))
    moving = np.flatnonzero(power > MOVES * scatter)
    edge = float(frequency[moving[-1]]) if len(moving) else MOST / dt
    return min(max(ABOVE * edge, ABOVE / (length * dt)), MOST / dt)
