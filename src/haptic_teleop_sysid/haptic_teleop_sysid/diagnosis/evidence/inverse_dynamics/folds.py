"""Every other stretch of recordings, to fit to the ones and to judge by the others."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model

from .motion import BandedMotion
from .regression import Equations
from .term import Term

FloatArray = NDArray[np.float64]

#: Stretches into which recordings are cut.
STRETCHES = 16


@dataclass(frozen=True)
class Fold:
    """Every other stretch of some recordings' equations together: what `Equations` has, of these rows."""

    parts: tuple[Equations, ...]
    odd: bool

    @property
    def model(self) -> Model:
        return self.parts[0].model

    @property
    def motions(self) -> tuple[BandedMotion, ...]:
        return tuple(m for part in self.parts for m in part.motions)

    @property
    def names(self) -> tuple[str, ...]:
        return self.parts[0].names

    @property
    def samples(self) -> int:
        return len(self.target)

    @cached_property
    def target(self) -> FloatArray:
        return self._rows(lambda part: part.target)

    @cached_property
    def base(self) -> FloatArray:
        return np.moveaxis(self._rows(lambda part: np.moveaxis(part.base, 1, 0)), 0, 1)

    def torque(self, term: Term) -> FloatArray:
        """See `Equations.torque`; the parts keep it, and rows of it are quickly taken."""
        return self._rows(lambda part: part.torque(term))

    def forget(self, terms: Iterable[Term]) -> None:
        """See `Equations.forget`."""
        gone = [*terms]
        for part in self.parts:
            part.forget(gone)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """See `Equations.bounds`."""
        return self.parts[0].bounds()

    def arm_scale(self, values: FloatArray) -> float:
        """See `Equations.arm_scale`."""
        return self.parts[0].arm_scale(values)

    def _rows(self, of: Callable[[Equations], FloatArray]) -> FloatArray:
        """Rows of this fold of all parts' arrays (n, ...)."""
        found = []
        for part in self.parts:
            rows = of(part)
            # The first sample of every stretch: k with k * STRETCHES // samples the stretch's number.
            edges = [-(-i * part.samples // STRETCHES) for i in range(STRETCHES + 1)]
            found += [rows[edges[i] : edges[i + 1]] for i in range(int(self.odd), STRETCHES, 2)]
        return np.concatenate(found)
