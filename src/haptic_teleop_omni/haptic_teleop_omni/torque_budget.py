"""What torque may flow: the peak at once, the continuous torque for ever, and a ramp after every start.

The excess E grows with tau² - continuous² and shrinks likewise, never below zero; once it exceeds
(peak² - continuous²) time the axis is held to its continuous torque until half of it is gone. A hand-held
device weakens, it does not let go: the sudden loss of force would be the surprise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from haptic_teleop_control.quantities import check_quantities, quantity
from haptic_teleop_control.robots import OMNI_CONTINUOUS_TORQUE, OMNI_PEAK_TORQUE


@dataclass(frozen=True)
class TorqueLimits:
    """Of every axis. Raises ConfigurationError naming the field for a value outside its range."""

    peak: float = quantity(OMNI_PEAK_TORQUE, "N·m", "largest torque", above=0.0, maximum=OMNI_PEAK_TORQUE)
    continuous: float = quantity(
        OMNI_CONTINUOUS_TORQUE,
        "N·m",
        "torque that may flow for ever",
        above=0.0,
        maximum=OMNI_CONTINUOUS_TORQUE,
    )
    time: float = quantity(
        5.0, "s", "time for which the peak may flow from cold (assumed)", above=0.0, maximum=60.0
    )
    ramp_time: float = quantity(
        0.2, "s", "from zero to full torque after a start or reset", minimum=0.0, maximum=5.0
    )

    def __post_init__(self) -> None:
        check_quantities(self)
        if self.continuous > self.peak:
            object.__setattr__(self, "continuous", self.peak)


class TorqueBudget:
    """n axes."""

    def __init__(self, n: int, limits: TorqueLimits) -> None:
        self.limits = limits
        self._capacity = (limits.peak**2 - limits.continuous**2) * limits.time
        self.excess = [0.0] * n
        self.weakened = [False] * n
        self._ramped = 0.0
        self.limited = 0

    def rest(self, elapsed: float) -> None:
        """`elapsed` s without torque; the next torque ramps in."""
        self._ramped = 0.0
        for i in range(len(self.excess)):
            self._spend(i, 0.0, elapsed)

    def step(self, torque: Sequence[float], elapsed: float) -> list[float] | None:
        """The torque (n,), N·m, that may flow for the next `elapsed` s; None when one is not finite."""
        if not math.isfinite(sum(torque)):
            return None
        limits = self.limits
        self._ramped = min(self._ramped + elapsed, limits.ramp_time)
        scale = self._ramped / limits.ramp_time if limits.ramp_time > 0.0 else 1.0
        allowed = []
        for i, wanted in enumerate(torque):
            bound = limits.continuous if self.weakened[i] else limits.peak
            value = min(max(float(wanted), -bound), bound)
            if value != wanted:
                self.limited += 1
            value *= scale
            self._spend(i, value, elapsed)
            allowed.append(value)
        return allowed

    def _spend(self, i: int, torque: float, elapsed: float) -> None:
        self.excess[i] = max(0.0, self.excess[i] + (torque**2 - self.limits.continuous**2) * elapsed)
        if self.excess[i] > self._capacity:
            self.weakened[i] = self._capacity > 0.0
        elif self.excess[i] < 0.5 * self._capacity:
            self.weakened[i] = False
