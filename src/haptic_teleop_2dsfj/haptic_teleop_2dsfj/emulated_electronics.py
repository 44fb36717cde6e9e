"""What hangs on the emulated board, in physical terms: lines of an encoder, turns of a gear, volts and
amperes.

Everything is stated here once more, from the sources and not from the driver's settings or the table of the
robots' facts: with the driver's own numbers a wrong scale of the driver would cancel out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Electronics:
    """A Q8 with the AMPAQ and the encoders of the 2DSFJ. Sources: thesis 2.4 (gears), Quanser's example for
    the sibling robot (encoder lines, amplifier), the Q8's manual (bits)."""

    encoder_lines: int = 1024
    """Per turn of an encoder; the counter counts both edges of both its signals."""
    drive_gears: tuple[float, float] = (100.0, 80.0)
    """Turns of a motor, where the drive's encoder is, per turn of its stage."""
    joint_gear: float = 6.23
    """Turns of a joint's encoder per turn of the joint."""
    amperes_per_volt: float = -0.5
    """Of the command; a positive voltage turns clockwise."""
    sense_volts_per_ampere: float = -0.5
    """Of the current's sense: 2 A make -1 V."""
    output_bits: int = 12
    input_bits: int = 14
    counter_bits: int = 24

    @property
    def counts_per_radian(self) -> list[float]:
        """Of both drives' counters, then of both joints', about the stage's and the joint's axis."""
        turn = 4 * self.encoder_lines / (2.0 * math.pi)
        return [gear * turn for gear in (*self.drive_gears, self.joint_gear, self.joint_gear)]
