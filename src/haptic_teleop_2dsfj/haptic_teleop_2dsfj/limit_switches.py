"""The limit switches: two Hall sensors per stage, active low, at the ends of the arm's range.

A hit stops the experiment (thesis 2.4.5): it is reported once, and the driver latches it. After a reset the
arm may be driven off the switch: current towards the stop is vetoed, away from it is allowed. A switch counts
as released only when it has been released for `debounce` samples, so that a bouncing one is one hit. A switch
that stays pressed although the arm has left, or both ends of a stage at once, are broken wiring.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

ENDS = ("STAGE 1: MAX", "STAGE 1: MIN", "STAGE 2: MAX", "STAGE 2: MIN")
"""The switches in the order of their levels; MAX is the counter-clockwise end."""

LEFT_BEHIND = 0.35
"""rad from where it was pressed, after which a switch that is still pressed is stuck (assumed: a magnet
passes a Hall sensor within a few degrees)."""


@dataclass
class LimitSwitches:
    """enabled: False only where the wiring is being looked for. debounce: samples."""

    enabled: bool = True
    debounce: int = 10
    pressed: list[bool] = field(default_factory=lambda: [False] * 4)
    hits: list[int] = field(default_factory=lambda: [0] * 4)
    _released_for: list[int] = field(default_factory=lambda: [0] * 4)
    _pressed_at: list[float] = field(default_factory=lambda: [0.0] * 4)
    _stuck: list[bool] = field(default_factory=lambda: [False] * 4)

    def start(self, levels: Sequence[int]) -> None:
        """The switches at the start, where the arms' angles are 0: who is pressed already vetoes its
        direction."""
        self.pressed = [self.enabled and level == 0 for level in levels]
        self._released_for = [0] * 4
        self._pressed_at = [0.0] * 4
        self._stuck = [False] * 4

    def step(self, levels: Sequence[int], arms: Sequence[float] = (0.0, 0.0)) -> tuple[str, str] | None:
        """One sample of the four levels and both arms' angles (rad). Returns (fault, detail) once for what
        was hit now, or for wiring that now shows to be broken; None otherwise."""
        if not self.enabled:
            return None
        struck, stuck = [], []
        for i, level in enumerate(levels):
            arm = arms[i // 2]
            if level == 0:
                self._released_for[i] = 0
                if not self.pressed[i]:
                    self.pressed[i] = True
                    self.hits[i] += 1
                    self._pressed_at[i] = arm
                    struck.append(ENDS[i])
            elif self.pressed[i]:
                self._released_for[i] += 1
                if self._released_for[i] >= self.debounce:
                    self.pressed[i] = self._stuck[i] = False
            way_back = self._pressed_at[i] - arm if i % 2 == 0 else arm - self._pressed_at[i]
            if self.pressed[i] and not self._stuck[i] and way_back > LEFT_BEHIND:
                self._stuck[i] = True
                stuck.append(ENDS[i])
        if stuck or (struck and self.impossible()):
            return "limit_switch_stuck", self.impossible() or ""
        return ("limit_switch", f"{' and '.join(struck)} limit switch hit") if struck else None

    def impossible(self) -> str | None:
        """What is wrong with the switches as they are now, which only broken wiring explains; or None."""
        for stage in range(2):
            if self.pressed[2 * stage] and self.pressed[2 * stage + 1]:
                return f"STAGE {stage + 1}: both ends are pressed at once"
        for name, stuck in zip(ENDS, self._stuck, strict=True):
            if stuck:
                return f"{name} limit switch is still pressed, though the arm has left it"
        return None

    def veto(self, stage: int, current: float) -> bool:
        """Whether `current` (A, counter-clockwise positive) of stage 0 or 1 pushes into a pressed switch."""
        return (current > 0.0 and self.pressed[2 * stage]) or (current < 0.0 and self.pressed[2 * stage + 1])
