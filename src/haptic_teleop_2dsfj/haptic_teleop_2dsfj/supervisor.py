"""What a sample of the robot may look like: the checks that find broken cables, sensors and amplifiers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from haptic_teleop_2dsfj.stage_settings import StageSettings
from haptic_teleop_control.quantities import check_quantities, quantity

HELD_SHARE = 0.5
"""Of the motor's torque, that the joint must carry to explain a drive that stands still: friction may carry
the rest."""

FAULTS = {
    "board_error": "the HIL board refused a call; check its cable, its power and who else uses it",
    "board_link": "connection to the board server lost; check cable, server log and other senders, "
    "then reset",
    "watchdog_expired": "the board's watchdog expired and put the outputs to 0 V; look for what kept the "
    "driver from its loop",
    "limit_switch": "the arm reached an end of its range; reset, then drive it away from the switch",
    "limit_switch_stuck": "limit switches report an impossible combination; check their cables and "
    "their supply",
    "overload": "the current was too high for too long (I²t); let the motor cool, look for a blocked joint",
    "deflection": "drive and joint encoder disagree by more than the limit; look for a blocked arm or a "
    "loose encoder",
    "encoder_jump": "an encoder moved faster than any motor turns it; check its cable",
    "encoder_frozen": "a drive's encoder does not count although the current is near its limit; "
    "check its cable",
    "over_current": "the measured current is above the limit; check the amplifier",
    "amplifier": "the measured current does not follow the commanded one; check power, emergency stop and "
    "cable of the amplifier",
    "non_finite_measurement": "the board delivered a value that is no finite number; check its configuration",
    "sample_clock": "the board's samples do not keep step with the computer's steady clock: it samples at "
    "another rate than was asked for, or loses samples without counting them; check rate and board.clock",
    "late": "the loop missed many samples in a row; lower the load of the machine or raise realtime_priority",
}
"""Faults of the driver, with the sentence for the log."""


@dataclass(frozen=True)
class SupervisorSettings:
    """Thresholds. Raises ConfigurationError naming the field for a value outside its range."""

    highest_speed: float = quantity(60.0, "rad/s", "no encoder moves faster", above=0.0)
    frozen_share: float = quantity(
        0.9, "", "share of current_limit at which an encoder must move", minimum=0.5, maximum=1.0
    )
    frozen_time: float = quantity(
        0.25, "s", "time for which it may stand still at that current", above=0.0, maximum=10.0
    )
    sense_margin: float = quantity(
        0.3, "A", "largest difference of the measured current from the commanded one", above=0.0
    )
    sense_time: float = quantity(0.05, "s", "time for which it may differ by more", above=0.0, maximum=1.0)

    def __post_init__(self) -> None:
        check_quantities(self)


class StageSupervisor:
    """One stage: remembers for how long something has been suspicious."""

    def __init__(self, settings: SupervisorSettings, stage: StageSettings, dt: float) -> None:
        self._settings, self._stage, self._dt = settings, stage, dt
        self._limit, self._trip = stage.current_limit, stage.deflection_trip
        self.reset()

    def reset(self) -> None:
        """Suspicions of the past are forgotten."""
        self._frozen = self._differs = self._above = 0.0

    def step(
        self,
        commanded: float,
        measured: float,
        drive: float,
        joint: float,
        change: float,
        joint_change: float,
        periods: int,
    ) -> tuple[str, str] | None:
        """One sample: the current in force (A) and the one measured, angles and their changes (rad) over
        `periods`. Returns (fault, detail), or None."""
        settings, elapsed = self._settings, self._dt * periods
        if not math.isfinite(measured):
            return "non_finite_measurement", f"measured current {measured}"
        fastest = max(abs(change), abs(joint_change)) / elapsed
        if fastest > settings.highest_speed:
            return "encoder_jump", f"{fastest:.0f} rad/s"
        if abs(drive - joint) > self._trip:
            return "deflection", f"{drive - joint:+.3f} rad, limit {self._trip:g} rad"
        self._above = self._above + elapsed if abs(measured) > self._limit + settings.sense_margin else 0.0
        if self._above > 3 * self._dt:
            return "over_current", f"{measured:+.2f} A measured, limit {self._limit:g} A"
        differs = abs(measured - commanded) > settings.sense_margin
        self._differs = self._differs + elapsed if differs else 0.0
        if self._differs > settings.sense_time:
            return "amplifier", f"{commanded:+.2f} A commanded, {measured:+.2f} A measured"
        still = change == 0.0 and abs(commanded) >= settings.frozen_share * self._limit
        if still and self._held(commanded, drive - joint):
            still = False
        self._frozen = self._frozen + elapsed if still else 0.0
        if self._frozen > settings.frozen_time:
            return "encoder_frozen", f"no count for {self._frozen:.2f} s at {commanded:+.2f} A"
        return None

    def _held(self, commanded: float, deflection: float) -> bool:
        # An arm that presses holds its drive still, but then the joint is bent the way the current pushes. A
        # drive that turns unseen bends it the other way, by the encoders.
        torque = math.copysign(self._stage.stiffness * deflection, deflection * commanded)
        return torque >= HELD_SHARE * self._stage.torque_constant * abs(commanded)
