"""How fast simulated time may run, and how fast it does."""

from __future__ import annotations

import math

from haptic_teleop_control.errors import ConfigurationError

SLACK = 0.02
"""Seconds of wall time that may be made up after a delay; what is later than that is late for good."""


def check_factor(factor: float) -> float:
    """The real-time factor, if it is one: 0 for as fast as it goes, or any positive number. Raises
    ConfigurationError."""
    if not (math.isfinite(factor) and factor >= 0.0):
        raise ConfigurationError(
            f"real_time_factor is {factor}; give a positive number, or 0 for as fast as it goes."
        )
    return factor


class Pace:
    """Times in s: `wall` of a clock that never jumps, `simulated` since time zero.

    achieved: simulated seconds per second of wall time from the first step on, pauses left out.
    """

    def __init__(self, factor: float) -> None:
        self._factor = check_factor(factor)
        self._anchor: tuple[float, float] | None = None  # wall, simulated
        self._ran = self._advanced = 0.0
        self._last: tuple[float, float] | None = None

    @property
    def factor(self) -> float:
        return self._factor

    @factor.setter
    def factor(self, value: float) -> None:
        self._factor = check_factor(value)
        self._anchor = None

    @property
    def achieved(self) -> float:
        return self._advanced / self._ran if self._ran > 0.0 else 0.0

    def stop(self) -> None:
        """Time does not run, and what goes by does not count."""
        self._anchor = self._last = None

    def wait(self, wall: float, simulated: float) -> float:
        """Seconds of wall time until `simulated` may come; 0 when it may now."""
        if self._factor == 0.0:
            return 0.0
        if self._anchor is None:
            self._anchor = (wall, simulated)
        begun, origin = self._anchor
        due = begun + (simulated - origin) / self._factor
        if wall - due > SLACK:
            self._anchor = (wall - SLACK, simulated)
            return 0.0
        return max(0.0, due - wall)

    def advanced(self, wall: float, simulated: float) -> None:
        """Time has come to `simulated`."""
        if self._last is not None:
            self._ran += wall - self._last[0]
            self._advanced += simulated - self._last[1]
        self._last = (wall, simulated)
