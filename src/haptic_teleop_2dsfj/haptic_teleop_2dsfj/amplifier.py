"""The AMPAQ amplifier: current to volts and back, with the sign that makes counter-clockwise positive.

    V = sign I / a_per_v        I_measured = sense_a_per_v V_sense

Quanser's example for the sibling robot has 0.5 A/V, a minus on the command and -2 A/V for the sense.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptic_teleop_control.quantities import check_quantities, quantity


@dataclass(frozen=True)
class Amplifier:
    """One channel. Raises ConfigurationError naming the field for a value outside its range."""

    a_per_v: float = quantity(
        0.5, "A/V", "current per volt of the command", name="amplifier.a_per_v", above=0.0
    )
    command_sign: int = quantity(
        -1, "", "-1 where a positive voltage turns clockwise", name="amplifier.command_sign", choices=(-1, 1)
    )
    sense_a_per_v: float = quantity(
        -2.0,
        "A/V",
        "measured current per volt of the sense, with its sign",
        name="amplifier.sense_a_per_v",
        minimum=-100.0,
        maximum=100.0,
    )

    def __post_init__(self) -> None:
        check_quantities(self)

    def volts(self, current: float, limit: float, step: float, highest: float) -> float:
        """V for `current`, A: on a step of the converter (`step` V), and never for more than `limit` A or
        `highest` V. Anything that is not finite gives 0."""
        if not math.isfinite(current):
            return 0.0
        bound = min(limit / self.a_per_v, highest)
        volts = round(min(max(current / self.a_per_v, -bound), bound) / step) * step
        if abs(volts) > bound:  # rounding to a step must not pass the limit
            volts = math.copysign(math.floor(bound / step) * step, volts)
        return self.command_sign * volts + 0.0

    def commanded(self, volts: float) -> float:
        """A, that `volts` command."""
        return self.command_sign * volts * self.a_per_v

    def measured(self, volts: float) -> float:
        """A, that `volts` of the sense mean."""
        return self.sense_a_per_v * volts
