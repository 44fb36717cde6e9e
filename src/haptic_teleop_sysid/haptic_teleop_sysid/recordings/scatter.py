"""What of a misfit the readings' own scatter makes: a velocity that is the difference of angle readings
scatters by their noise over the sampling time, and the best model is no nearer to it than that."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sysid.recordings.dataset import DataSet

Array = NDArray[np.float64]
SMOOTH = 0.03
"""s over which a joint's velocity is a parabola: what lies off that is scatter. Of readings so seldom that
five of them take twice as long nothing is known."""


def scatter(values: Array, dt: float) -> float:
    """Share (rms) of the variation of a velocity (n,) that is scatter of its readings, 0 to 1; 0 where that
    cannot be told."""
    length = max(5, 2 * int(0.5 * SMOOTH / dt) + 1)
    good = np.isfinite(values)
    if np.sum(good) < 2 * length or length * dt > 2.0 * SMOOTH:
        return 0.0
    known = np.interp(np.arange(len(values)), np.flatnonzero(good), values[good])
    off = (known - scipy.signal.savgol_filter(known, length, 2))[good]
    # A parabola follows a little of white scatter: 9 / (4 n) of its power (Savitzky and Golay 1964).
    share = float(np.mean(off**2)) / max(1.0 - 9.0 / (4.0 * length), 0.5)
    return min(math.sqrt(share / max(float(np.var(known[good])), 1e-300)), 1.0)


def beyond_scatter(percent: Mapping[str, float], dataset: DataSet) -> dict[str, float]:
    """The fits (percent, by signal) that a judgement rests on: those of velocities without what scatter makes
    of the misfit, 100 (1 - sqrt(e^2 - s^2)), e the misfit and s the scatter, as shares of the variation."""
    signals = dataset.signals()
    found = dict(percent)
    for name, fit in percent.items():
        if name.endswith(".velocity") and name in signals and np.isfinite(fit):
            error, own = 1.0 - fit / 100.0, scatter(signals[name], dataset.dt)
            found[name] = 100.0 * (1.0 - math.sqrt(max(error**2 - own**2, 0.0)))
    return found
