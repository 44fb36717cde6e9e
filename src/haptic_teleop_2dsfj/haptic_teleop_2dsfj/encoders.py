"""From counts to angles: counters that wrap, and jumps that no motor can make."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class EncoderBank:
    """n encoders. resolutions: rad per count, with sign. bits: width of the counters, which wrap.

    Starts at the first sample's counts, which the board has just zeroed: angles are relative to the pose at
    the start.
    """

    def __init__(self, resolutions: Sequence[float], bits: int) -> None:
        self._resolutions = np.array(resolutions, dtype=np.float64)
        self._span = 1 << bits
        self.angle: Array = np.zeros(len(self._resolutions))
        self.change: Array = np.zeros(len(self._resolutions))
        self._last = [0] * len(self._resolutions)
        self._total = [0] * len(self._resolutions)

    def reset(self) -> None:
        """Zero, as after the board's counters were zeroed."""
        self._last = [0] * len(self._last)
        self._total = [0] * len(self._total)
        self.angle[:] = 0.0
        self.change[:] = 0.0

    def step(self, counts: Sequence[int]) -> None:
        """Takes the counters' values; then `angle` and `change` (n,), rad, are up to date."""
        half = self._span // 2
        for i, count in enumerate(counts):
            difference = (int(count) - self._last[i] + half) % self._span - half
            self._last[i] = int(count)
            self._total[i] += difference
            self.change[i] = difference * self._resolutions[i]
            self.angle[i] = self._total[i] * self._resolutions[i]
