"""The limit switches: two Hall sensors per stage, active low, at the ends of the arm's range.

A hit stops the experiment (thesis 2.4.5): it is reported once, and the driver latches it. After a reset the
arm may be driven off the switch: current towards the stop is vetoed, away from it is allowed. A switch counts
as released only when it has been released for `debounce` samples, so that a bouncing one is one hit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

ENDS = ("STAGE 1: MAX", "STAGE 1: MIN", "STAGE 2: MAX", "STAGE 2: MIN")
"""The switches in the order of their levels; MAX is the counter-clockwise end."""


@dataclass
class LimitSwitches:
    """enabled: False only where the wiring is being looked for. debounce: samples."""

    enabled: bool = True
    debounce: int = 10
    pressed: list[bool] = field(default_factory=lambda: [False] * 4)
    hits: list[int] = field(default_factory=lambda: [0] * 4)
    _released_for: list[int] = field(default_factory=lambda: [0] * 4)

    def start(self, levels: Sequence[int]) -> str | None:
        """The switches at the start: who is pressed already vetoes its direction. Returns what is wrong when
        both ends of a stage are pressed, which only broken wiring does; None otherwise."""
        self.pressed = [self.enabled and level == 0 for level in levels]
        self._released_for = [0] * 4
        for stage in range(2):
            if self.pressed[2 * stage] and self.pressed[2 * stage + 1]:
                return f"STAGE {stage + 1}: both ends are pressed at once"
        return None

    def step(self, levels: Sequence[int]) -> str | None:
        """One sample of the four levels; names the switches that were hit now, or None."""
        if not self.enabled:
            return None
        struck = []
        for i, level in enumerate(levels):
            if level == 0:
                self._released_for[i] = 0
                if not self.pressed[i]:
                    self.pressed[i] = True
                    self.hits[i] += 1
                    struck.append(ENDS[i])
            elif self.pressed[i]:
                self._released_for[i] += 1
                if self._released_for[i] >= self.debounce:
                    self.pressed[i] = False
        return f"{' and '.join(struck)} limit switch hit" if struck else None

    def veto(self, stage: int, current: float) -> bool:
        """Whether `current` (A, counter-clockwise positive) of stage 0 or 1 pushes into a pressed switch."""
        return (current > 0.0 and self.pressed[2 * stage]) or (current < 0.0 and self.pressed[2 * stage + 1])
