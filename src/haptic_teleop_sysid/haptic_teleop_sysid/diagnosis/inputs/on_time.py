"""Recordings with their input at the times at which it acts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.recordings.dataset import DataSet


def on_time(data: DataSet, delay: float) -> DataSet:
    """The data set with the input that acts from each sample to the next where it acts ``delay`` s after the
    time that it is recorded with (negative: before)."""
    samples = delay / data.dt
    valid = data.valid
    if len(valid):  # what came in a hole is not known
        valid = valid & (delayed(valid.astype(float), samples) > 1.0 - 1e-9)
    return replace(data, input=delayed(data.input, samples), valid=valid)


def delayed(values: NDArray[np.float64], samples: float) -> NDArray[np.float64]:
    """What acts on average from each sample to the next (n,), of ``values`` (n,) that are held from each to
    the next and come so many ``samples`` late (negative: early); beyond the ends as they are there."""
    whole = math.floor(samples)
    part = samples - whole
    places = np.arange(len(values)) - whole
    one, other = (values[np.clip(p, 0, len(values) - 1)] for p in (places, places - 1))
    if part == 0.0:
        return one
    return np.asarray((1.0 - part) * one + part * other)
