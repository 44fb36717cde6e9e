"""How fast a motion mostly is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def median_periods(velocity: NDArray[np.float64]) -> int:
    """Return how many periods of its median frequency a motion of this velocity (n,) makes: half of its
    power, without the mean, is at lower frequencies. 0 for one that is slower than the recording is long."""
    power = np.abs(np.fft.rfft((velocity - velocity.mean()) * np.hanning(len(velocity)))) ** 2
    return int(np.searchsorted(np.cumsum(power), 0.5 * np.sum(power)))
