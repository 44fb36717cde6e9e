"""Time from a state's stamp to the arrival of the command that answers it."""

from __future__ import annotations

import numpy as np


class LatencyMeter:
    """Keeps the last `size` latencies; `add` costs no allocation."""

    def __init__(self, size: int = 2048) -> None:
        self._values = np.zeros(size)
        self.count = 0

    def add(self, latency_ns: int) -> None:
        self._values[self.count % len(self._values)] = latency_ns
        self.count += 1

    def recent(self) -> np.ndarray:
        """The latencies kept, s, the oldest first."""
        size = len(self._values)
        if self.count <= size:
            return self._values[: self.count] * 1e-9
        return np.roll(self._values, -(self.count % size)) * 1e-9

    def summary(self) -> dict[str, str]:
        """Median and 99th percentile for diagnostics; empty before the first."""
        if not self.count:
            return {}
        median, high = np.percentile(self.recent(), (50, 99)) * 1e3
        return {"loop latency p50 (ms)": f"{median:.3f}", "loop latency p99 (ms)": f"{high:.3f}"}
