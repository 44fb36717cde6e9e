"""Recordings thinned for the free runs that rank models: long ones at a high rate tell no better which of two
models is nearer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.estimation.records import thinning
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.velocity_series import velocity_series
from haptic_teleop_sysid.simulation.windows import Windows

#: Rate that is kept, relative to the cut-off of the motion's band.
KEPT_OF_BAND = 4.0


def thinned_data(data: Sequence[DataSet], cutoff: float) -> list[tuple[DataSet, int]]:
    """Each data set with every k-th reading and the mean of the input over the k samples that follow, and its
    k: as few samples as `records.thinning` allows, at no less than KEPT_OF_BAND times ``cutoff``, Hz."""
    rate = thinning(sum(map(len, data)), min(d.dt for d in data), KEPT_OF_BAND * cutoff)
    found = []
    for one in data:
        k = min(int(1.0 / (one.dt * rate) + 1e-6), len(one))
        found.append((_thinned(one, k), k) if k > 1 else (one, 1))
    return found


def coarser(windows: Windows, k: int) -> Windows:
    """The same windows where each sample stands for ``k``."""
    return replace(windows, spans=tuple((-(-start // k), stop // k) for start, stop in windows.spans))


def _thinned(data: DataSet, k: int) -> DataSet:
    n = len(data) // k

    def every(values: NDArray | None) -> NDArray | None:
        return None if values is None else values[: n * k : k].copy()

    def mean(values: NDArray | None) -> NDArray | None:
        return None if values is None else values[: n * k].reshape(n, k).mean(axis=1)

    thin = replace(
        data,
        dt=k * data.dt,
        input=np.asarray(mean(data.input)),
        commanded_input=mean(data.commanded_input),
        exogenous=mean(data.exogenous),
        motor_position=np.asarray(every(data.motor_position)),
        motor_velocity=np.asarray(every(data.motor_velocity)),
        arm_position=every(data.arm_position),
        arm_velocity=every(data.arm_velocity),
        valid=np.asarray(every(data.valid)),
    )
    if data.velocity_filter is None:
        return thin
    # By the same filter over the angles that remain, as those that are simulated will be.
    own = data.velocity_filter
    thin = replace(thin, motor_velocity=velocity_series(thin.motor_position, thin.dt, *own))
    if thin.arm_position is None or thin.arm_velocity is None:
        return thin
    return replace(thin, arm_velocity=velocity_series(thin.arm_position, thin.dt, *own))
