"""What a simulated robot says about one step, instead of raising."""

from __future__ import annotations

from enum import IntFlag


class StepResult(IntFlag):
    """Zero when all was well; otherwise what happened, for all motors of the robot together."""

    OK = 0
    REFUSED_COMMAND = 1
    """A command was not finite: that motor got zero."""
    LIMITED = 2
    """A command was beyond the current or torque limit: the limit was applied."""
    DIVERGED = 4
    """A plant left the finite numbers and was put back to rest at zero: its model cannot be simulated."""
