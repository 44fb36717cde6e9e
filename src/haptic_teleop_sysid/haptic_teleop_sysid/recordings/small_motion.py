"""Signals that hardly move: a fit is a share of a signal's own variation, and a share of next to nothing
tells of encoder steps and noise, not of a model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.recordings.dataset import DataSet

Array = NDArray[np.float64]
SMALLEST_SPREAD = {"rad": 5e-3, "rad/s": 0.02, "N·m": 5e-3}
"""A signal that hardly varies tells nothing about a fit: one whose middle 99 % of samples lie within this."""
OUTLIERS = 0.01
"""Share of the samples, the greatest and the least together, that make no variation by themselves: the few
before a device is driven, for example."""


def spread(values: Array) -> float:
    """How far the greatest and the least of `values` (n,) lie apart, without the OUTLIERS and what is no
    number; 0 without any."""
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0
    least, greatest = np.quantile(values, [0.5 * OUTLIERS, 1.0 - 0.5 * OUTLIERS])
    return float(greatest - least)


def hardly_moving(data: Iterable[DataSet]) -> set[str]:
    """Signals that hardly move on any of the recordings, and velocities of positions that hardly do; none
    where all of them do: then that is the motion of this machine (`at_rest`)."""
    moving, every = _moving(data)
    return every - moving if moving else set()


def at_rest(data: Iterable[DataSet]) -> bool:
    """Whether no signal moves by more than next to nothing on any of the recordings."""
    return not _moving(data)[0]


def _moving(data: Iterable[DataSet]) -> tuple[set[str], set[str]]:
    """The signals that move on any of the recordings, and all."""
    moving, every = set(), set()
    for dataset in data:
        units, signals = dataset.units(), dataset.signals()
        large = {n: spread(v) >= SMALLEST_SPREAD.get(units[n], 0.0) for n, v in signals.items()}
        # The faster a tiny motion, the greater its velocity, and the encoder's steps in it.
        moving |= {n for n in large if large[n] and large.get(_position_of(n), True)}
        every |= set(large)
    return moving, every


def _position_of(signal: str) -> str:
    """The position that a velocity is of; another signal itself."""
    place, _, kind = signal.rpartition(".")
    return f"{place}.position" if kind == "velocity" else signal


def judged(percent: Mapping[str, float], still: set[str]) -> dict[str, float]:
    """The fits (percent, by signal) that a judgement rests on: without those of signals that hardly move."""
    return {name: fit for name, fit in percent.items() if name not in still} or dict(percent)
