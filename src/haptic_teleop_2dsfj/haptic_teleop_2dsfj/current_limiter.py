"""From a commanded effort to a current that may flow: every limit in series, none of which trusts another.

effort -> current -> drift correction -> ramp-in -> slew -> limit -> limit switches
"""

from __future__ import annotations

import math
from enum import IntFlag

from haptic_teleop_2dsfj.limit_switches import LimitSwitches
from haptic_teleop_2dsfj.overload import Overload
from haptic_teleop_2dsfj.stage_settings import StageSettings


class LimitResult(IntFlag):
    """What was done to a command."""

    OK = 0
    REFUSED = 1
    """It was not finite: zero."""
    LIMITED = 2
    SLEWED = 4
    VETOED = 8
    """It pushed into a pressed limit switch: zero."""
    OVERLOAD = 16
    """I²t is used up: zero, and it must be reported."""


class CurrentLimiter:
    """One stage, 0 or 1. `current` is what flows now, A. ramp_time: s from none to all of a command after
    `rest` or `halt`."""

    def __init__(
        self, stage: int, settings: StageSettings, switches: LimitSwitches, dt: float, ramp_time: float = 0.0
    ) -> None:
        self.settings = settings
        self._ramp_time, self._ramped = ramp_time, 0.0
        self.overload = Overload(settings.continuous_current, settings.current_limit, settings.overload_time)
        self.current = 0.0
        self._stage, self._switches, self._dt = stage, switches, dt

    def step(self, effort: float, periods: int = 1) -> LimitResult:
        """One sample with `effort`, N·m, `periods` after the last one; then `current` holds what may flow,
        within every limit."""
        settings = self.settings
        if periods > 1:  # while the loop was late, what flowed before went on flowing
            self.overload.step(self.current, (periods - 1) * self._dt)
        result = LimitResult.OK
        wanted = effort / settings.torque_constant + settings.drift_correction
        # The time since power came, not its samples: a late loop does not make the ramp longer.
        self._ramped = min(self._ramped + periods * self._dt, self._ramp_time)
        if self._ramped < self._ramp_time:
            wanted *= self._ramped / self._ramp_time
        if not math.isfinite(wanted):
            wanted, result = 0.0, LimitResult.REFUSED
        way = settings.current_slew * self._dt
        if abs(wanted - self.current) > way:
            wanted = self.current + math.copysign(way, wanted - self.current)
            result |= LimitResult.SLEWED
        limit = settings.current_limit
        if abs(wanted) > limit:
            wanted = math.copysign(limit, wanted)
            result |= LimitResult.LIMITED
        if self._switches.veto(self._stage, wanted):
            wanted = 0.0
            result |= LimitResult.VETOED
        if self.overload.step(wanted, self._dt):
            wanted = 0.0
            result |= LimitResult.OVERLOAD
        self.current = wanted
        return result

    def rest(self, periods: int = 1) -> None:
        """`periods` samples without current, once that which flows has ended."""
        if periods > 1:
            self.overload.step(self.current, (periods - 1) * self._dt)
        self.halt()
        self.overload.step(0.0, self._dt)

    def halt(self) -> None:
        """No current from now on; the next command ramps in."""
        self.current = self._ramped = 0.0
