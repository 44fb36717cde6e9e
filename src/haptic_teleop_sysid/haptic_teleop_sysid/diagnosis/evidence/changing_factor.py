"""How much likelier recordings are if a torque x(t) f(t) acts whose factor f changes with time.

The factor is constant in cells of time, and a random process over them: normally distributed with one size,
correlated over one memory (an Ornstein-Uhlenbeck process; white without memory). Then the torque adds to the
innovations of an observer, which are white and linear in it, a normally distributed part, and the logarithm
of the likelihood ratio is known in closed form (Rasmussen and Williams 2006, 2.3). Unlike a best fit it needs
no allowance for the number of factors, and a torque has all its history: an observer that adds a torque of
its own is surprised by a change, and hardly by what stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve
from scipy.sparse import csr_array

FloatArray = NDArray[np.float64]

#: Length of a cell, s, and how many the longest of some recordings has at most.
CELL, MOST_CELLS = 0.05, 480
#: Memories of the factor that are tried, s, and its sizes.
MEMORIES = (0.0, 0.1, 0.3, 1.0, 3.0)
SIZES = np.geomspace(1e-3, 30.0, 24)
#: Smallest share of the diagonal that keeps a covariance regular.
_REGULAR = 1e-9


@dataclass(frozen=True)
class Surprise:
    """The innovations of one recording: ``errors`` (m,), what is allowed for beside, ``allowed`` (m, k)
    orthonormal columns, the samples that were ``read`` (samples, channels), of which the last m / channels
    count, and the observer's ``answer`` (l, channels) to a unit of torque for one sample of ``dt`` s."""

    errors: FloatArray
    allowed: FloatArray
    read: NDArray[np.bool_]
    answer: FloatArray
    dt: float


def cell_length(durations: Sequence[float]) -> float:
    """Length of a cell, s, on recordings of these lengths, s: the same on all, as the size of a factor
    without memory goes with it."""
    return max(CELL, max(durations) / MOST_CELLS)


def log_evidence(surprise: Surprise, values: FloatArray, cell: float = CELL) -> FloatArray:
    """The logarithm (nats) of the likelihood ratio for each of MEMORIES (row) and SIZES (column) of the
    factor of a torque with these ``values`` (samples,), in cells of ``cell`` s. A reading that is missing
    leaves the other encoder's as if both were read."""
    cells = _cells(len(values), surprise.dt, cell)
    columns = _columns(surprise, values, cells)
    left = surprise.errors - surprise.allowed @ (surprise.allowed.T @ surprise.errors)
    along = columns.T @ left
    within = columns.T @ surprise.allowed
    power = (columns.T @ columns).toarray() - within @ within.T
    times = cells[:-1] * surprise.dt
    found = np.empty((len(MEMORIES), len(SIZES)))
    for row, memory in enumerate(MEMORIES):
        likeness = np.eye(len(times))
        if memory:
            likeness = np.exp(-np.abs(times[:, None] - times[None, :]) / memory) + _REGULAR * likeness
        root = np.linalg.cholesky(likeness)
        strength, axes = np.linalg.eigh(root.T @ power @ root)
        strength = np.maximum(strength, 0.0)
        moved = (axes.T @ (root.T @ along)) ** 2
        spread = SIZES[:, None] ** 2
        each = spread * moved / (1.0 + spread * strength) - np.log1p(spread * strength)
        found[row] = 0.5 * np.sum(each, axis=1)
    return found


def best(evidence: Sequence[FloatArray]) -> float:
    """The largest log evidence of several recordings together, with one memory and size for all."""
    return float(np.max(np.sum(evidence, axis=0)))


def _cells(samples: int, dt: float, cell: float) -> NDArray[np.intp]:
    """The first sample of each cell, and the end of the last one."""
    size = max(round(cell / dt), 1)
    return np.append(np.arange(max(samples // size, 1)) * size, samples)


def _columns(surprise: Surprise, values: FloatArray, cells: NDArray[np.intp]) -> csr_array:
    """What the torque of each cell (column) adds to the innovations (row)."""
    samples, channels = surprise.read.shape
    skipped = samples - len(surprise.errors) // channels
    rows, columns, found = [], [], []
    for number, (start, end) in enumerate(pairwise(cells)):
        added = fftconvolve(values[start:end, None], surprise.answer, axes=0)[: samples - start]
        first = max(skipped - start, 0)
        counts = surprise.read[start + first : start + len(added)]
        at = np.arange(start + first - skipped, start + len(added) - skipped)
        rows.append((at[:, None] * channels + np.arange(channels))[counts])
        found.append(added[first:][counts])
        columns.append(np.full(len(found[-1]), number))
    where = np.concatenate(rows), np.concatenate(columns)
    return csr_array((np.concatenate(found), where), shape=(len(surprise.errors), len(cells) - 1))
