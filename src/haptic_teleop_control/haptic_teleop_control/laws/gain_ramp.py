"""Gains that change while a law runs: a straight line to the new ones, so that no torque jumps."""

from __future__ import annotations

import numpy as np

from haptic_teleop_control.laws.contract import Array

RAMP_TIME = 0.2
"""s. Long against a sample and the drives' lags, short for the one who turns the knob."""


class GainRamp:
    """A matrix of gains, (stages, gains), that follows `to` within `time` s, stepped every `dt` s.

    value: the gains in force, always the same array, changed in place. Columns `at_once` do not wait: limits
    that protect, and constants that only convert. Between a finite and an infinite value the reciprocal
    changes evenly, so that a limit opens gradually, too.
    """

    def __init__(
        self, value: Array, dt: float, at_once: tuple[int, ...] = (), time: float = RAMP_TIME
    ) -> None:
        self.value = np.array(value, dtype=np.float64)
        self._at_once = list(at_once)
        self._steps = max(1, round(time / dt))
        self._left = 0
        self._from = self.value.copy()
        self._to = self.value.copy()
        self._reciprocal = np.zeros(self.value.shape, dtype=np.bool_)

    @property
    def moving(self) -> bool:
        """Whether the value has not arrived yet."""
        return self._left > 0

    def to(self, value: Array) -> None:
        """Begins to change towards `value`, from where it is now."""
        self._to[:] = value
        self.value[:, self._at_once] = self._to[:, self._at_once]
        self._from[:] = self.value
        opens_or_closes = np.isinf(self._from) != np.isinf(self._to)
        self._reciprocal[:] = opens_or_closes & (self._from != 0.0) & (self._to != 0.0)
        self._left = self._steps

    def jump(self, value: Array | None = None) -> None:
        """Is at `value` at once, or at the end of the change under way."""
        if value is not None:
            self._to[:] = value
        self.value[:] = self._to
        self._left = 0

    def step(self) -> None:
        """One sample on; when the change is over, `value` is what `to` was given, bit by bit."""
        if self._left <= 1:
            self.jump()
            return
        self._left -= 1
        done = 1.0 - self._left / self._steps
        with np.errstate(invalid="ignore", divide="ignore"):
            line = self._from + done * (self._to - self._from)
            opened = 1.0 / (1.0 / self._from + done * (1.0 / self._to - 1.0 / self._from))
        line = np.where(self._reciprocal, opened, line)
        # From infinite to infinite, or from zero to infinite, there is no line.
        self.value[:] = np.where(np.isnan(line), self._to, line)
