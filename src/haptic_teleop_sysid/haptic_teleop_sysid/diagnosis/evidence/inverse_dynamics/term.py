"""What a regression on the equations of motion takes as a term: an effect, a free curve, a law's
product."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

from .motion import BandedMotion

FloatArray = NDArray[np.float64]


class Term(Protocol):
    """A torque at a place, linear in the factors of its columns."""

    @property
    def place(self) -> str:
        """motor | arm | joint"""
        ...

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """Torques (N·m) at the samples that count, (n, columns), filtered like the input."""
        ...

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest factor of each column."""
        ...

    def __hash__(self) -> int: ...
