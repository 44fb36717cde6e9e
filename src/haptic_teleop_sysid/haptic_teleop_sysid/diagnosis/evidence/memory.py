"""Does what is left follow the input, or the velocity, with a memory?

A curve over a measured quantity knows no past.  What an amplifier that blocks direct current takes away, or
grease that thins while it is stirred, follows a low-passed input or velocity: random it looks, and on other
recordings the same filters predict it.  Input and velocity are asked apart, because both together say by the
equations of motion what any torque is.  In a closed loop the input answers to random torque, too, but a
random torque is small on a machine, and so is its part of the input.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import after_settling
from haptic_teleop_sysid.estimation.records import Record

from .residual import LeftOver, left_over

FloatArray = NDArray[np.float64]

#: Low passes of a quantity, from so many samples to such a share of the shortest recording.
_FILTERS, _SHORTEST, _LONGEST = 6, 5.0, 0.1
#: Share of the velocity's rms within which its sign turns, and ridge on columns of unit size.
_TURNS, _RIDGE = 0.05, 1e-3


@dataclass(frozen=True)
class Remembered:
    """What a left-over torque follows with a memory: ``equation``, ``name`` of the quantity, share
    ``explained`` on recordings to which the filters were not fitted (the smaller of either kind) beyond what
    the quantity explains as it is, and the ``size`` of that part, N·m (rms)."""

    equation: str
    name: str
    explained: float
    size: float


def remembered(
    fit: Fit, estimation: Sequence[Record], validation: Sequence[Record], joint: str
) -> list[Remembered]:
    """The quantities that explain anything of a left-over torque with a memory."""
    sides = [[(r, left_over(fit, r)) for r in records] for records in (estimation, validation)]
    shortest = min(len(r) * r.dt for side in sides for r, _ in side)
    slowest = max(r.dt for side in sides for r, _ in side)
    times = np.geomspace(_SHORTEST * slowest, _LONGEST * shortest, _FILTERS).tolist()
    places = ("motor",) if fit.model.rigid else ("motor", "arm")
    found = []
    for channel, place in enumerate(places):
        for name in ("input torque", f"{place} velocity"):
            both = [_side(side, channel, name, times) for side in sides]
            now = [_side(side, channel, name, ()) for side in sides]
            share = min(
                _explained(both[k], both[1 - k]) - max(_explained(now[k], now[1 - k]), 0.0) for k in (0, 1)
            )
            if share > 0.0:
                whole = min(float(np.mean(torque**2)) for _, torque in both)
                found.append(Remembered(f"{joint}_{place}", name, share, float(np.sqrt(share * whole))))
    return found


def _side(
    side: Sequence[tuple[Record, LeftOver]], channel: int, name: str, times: Iterable[float]
) -> tuple[FloatArray, FloatArray]:
    """Columns (n, p) and torque (n,) of the recordings of one kind, where all encoders were read."""
    values = [np.nan_to_num(left.quantities[name]) for _, left in side]
    turns = _TURNS * max(float(np.sqrt(np.mean(np.concatenate(values) ** 2))), 1e-300)
    rows, torque = [], []
    for (record, left), value in zip(side, values, strict=True):
        signals = [value]
        if name.endswith("velocity"):
            signals += [np.abs(value), np.tanh(value / turns)]
        columns = [np.ones(len(value))]
        for signal in signals:
            columns += [signal, *(_low_passed(signal, record.dt / time) for time in times)]
        read = after_settling(record, left.read)
        rows.append(after_settling(record, np.column_stack(columns))[read])
        torque.append(after_settling(record, left.torque[:, channel])[read])
    return np.concatenate(rows), np.concatenate(torque)


def _low_passed(values: FloatArray, step: float) -> FloatArray:
    """Values (n,) through a first-order low pass of 1 / ``step`` samples, at rest at the first one."""
    kept = np.exp(-step)
    start = scipy.signal.lfiltic([1.0 - kept], [1.0, -kept], [values[0]])
    return np.asarray(scipy.signal.lfilter([1.0 - kept], [1.0, -kept], values, zi=start)[0])


def _explained(learn: tuple[FloatArray, FloatArray], judge: tuple[FloatArray, FloatArray]) -> float:
    """Share of the torque of ``judge`` (mean square) that the filters fitted to ``learn`` explain."""
    size = np.maximum(np.sqrt(np.mean(learn[0] ** 2, axis=0)), 1e-300)
    columns, torque = learn[0] / size, learn[1]
    products = columns.T @ columns + _RIDGE * len(torque) * np.eye(len(size))
    with np.errstate(over="ignore", invalid="ignore"):
        left = judge[1] - (judge[0] / size) @ np.linalg.solve(products, columns.T @ torque)
        share = 1.0 - float(np.mean(left**2)) / max(float(np.mean(judge[1] ** 2)), 1e-300)
    return share if np.isfinite(share) else 0.0
