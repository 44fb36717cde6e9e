"""Does an encoder that errs make the torques fit better?

An error that follows the angle can be taken out of the readings. If the encoder errs so, the accelerations of
the true angle fit the torques better than those of the readings. A smooth warp of the angle is also what a
one-step prediction buys for a torque whose form is not quite right; then the torques fit worse with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from .groups import Search
from .regression import equations
from .terms import Hypothesis

FloatArray = NDArray[np.float64]

#: Points of the curve from the true angle to the reading, over what was read and a tenth more at either end:
#: at least, per rad (the finest encoder's error has 200 cycles a turn), and at most.
_POINTS, _PER_RADIAN, _MOST_POINTS = 4096, 1000, 2_000_000


def torques_left(
    model: Model, learn: Sequence[Record], judge: Sequence[Record], group: Sequence[Effect], cutoff: float
) -> float:
    """Torque, N·m rms, that a group of effects leaves of a rigid joint's: those of either kind of recordings
    with parameters fitted to the other."""
    sides = equations(model, learn, cutoff), equations(model, judge, cutoff)
    search = Search(model, *sides)
    terms = tuple(Hypothesis.of(e, model.place(e.location)) for e in group)
    squares = [
        side.square_left(terms, search.fitted(1 - k, terms)) / float(side.weights[0]) ** 2
        for k, side in enumerate(search.sides)
    ]
    return float(np.sqrt(sum(squares) / sum(side.samples for side in sides)))


def can_correct(error: Effect) -> bool:
    """Whether an effect is an error of what an encoder reads that follows the angle, or a reading that is
    late."""
    return error.entry.kind == "skew" or (error.entry.kind == "output" and error.entry.equation is not None)


def corrected(record: Record, error: Effect, channel: int = 0) -> Record:
    """The record with such an error of the encoder of motor (0) or arm (1) taken out of the angles; missing
    where a reading is."""
    read = record.measured[:, channel]
    seen = np.isfinite(read)
    if not seen.any():
        return record
    if error.entry.kind == "skew":
        true = _earlier(read, seen, sum(error.parameters.values()) / record.dt)
    else:
        true = _inverted(read, error)
    measured = record.measured.copy()
    measured[:, channel] = np.where(seen, true, np.nan)
    return replace(record, measured=measured)


def _earlier(read: FloatArray, seen: NDArray[np.bool_], samples: float) -> FloatArray:
    """Readings (n,) that are so many ``samples`` late, at their time; beyond the ends as they are there."""
    place = np.arange(len(read), dtype=float)
    return np.asarray(np.interp(place + samples, place[seen], read[seen]))


def _inverted(read: FloatArray, error: Effect) -> FloatArray:
    low, high = float(np.nanmin(read)), float(np.nanmax(read))
    beyond = 0.1 * (high - low)
    number = min(max(_POINTS, round(_PER_RADIAN * (high - low))), _MOST_POINTS)
    true = np.linspace(low - beyond, high + beyond, number)
    equation = error.entry.equation
    assert equation is not None
    shown = np.asarray(equation(SimpleNamespace(position=true, **NUMERIC), SimpleNamespace(**error.values)))
    return np.asarray(np.interp(read, np.maximum.accumulate(shown), true))
