"""I²t: a motor may carry more than its continuous current, but only for a while.

The excess E grows with I² - I_continuous² and shrinks in the same way, never below zero:

    E' = I² - I_continuous²,   trip when E exceeds (I_limit² - I_continuous²) time

so that the current limit may flow for `time` from cold, and the continuous current for ever.
"""

from __future__ import annotations


class Overload:
    """One motor. continuous, limit: A; time: s that the limit may flow."""

    def __init__(self, continuous: float, limit: float, time: float) -> None:
        self._continuous = continuous**2
        self.capacity = max(limit**2 - continuous**2, 0.0) * time
        self.excess = 0.0

    def step(self, current: float, dt: float) -> bool:
        """dt seconds with `current` (A); True when the excess is used up."""
        self.excess = max(0.0, self.excess + (current * current - self._continuous) * dt)
        return self.capacity > 0.0 and self.excess > self.capacity

    @property
    def used(self) -> float:
        """0: cold, 1: trips."""
        return self.excess / self.capacity if self.capacity > 0.0 else 0.0
