"""Times of samples without a clock, and the series that a recording keeps."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import JointStateSeries
from haptic_teleop_control.simulated_time.stamps import ORIGIN, sample_count

Array = NDArray[np.float64]


def sample_times(rate: float, duration: float) -> Array:
    """(n,) s: 0, 1/rate, ... up to, not including, `duration`. Raises ConfigurationError for a duration that
    is not a positive number of seconds.
    """
    if not (math.isfinite(duration) and duration > 0.0):
        raise ConfigurationError(f"lockstep: the duration is {duration} s; give a number above 0.")
    return np.arange(sample_count(rate, duration)) / rate


def stamps(times: Array) -> NDArray[np.int64]:
    """(n,) ns, of times in s."""
    return ORIGIN + np.rint(times * 1e9).astype(np.int64)


def series(
    times: Array,
    names: Sequence[str],
    states: Array | None = None,
    position: Array | None = None,
    effort: Array | None = None,
) -> JointStateSeries:
    """One topic; `states` (n, 3, joints) holds position, velocity and effort, or give the one field that
    there is.
    """
    velocity = None
    if states is not None:
        position, velocity, effort = (np.ascontiguousarray(states[:, row]) for row in range(3))
    stamp = stamps(times)
    return JointStateSeries(stamp, stamp.copy(), tuple(names), position, velocity, effort)
