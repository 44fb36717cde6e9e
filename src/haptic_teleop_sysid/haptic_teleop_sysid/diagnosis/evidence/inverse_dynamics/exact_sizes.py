"""What an actuator makes of the input, evaluated at the size that the equations want.

Between the sizes that are tried it is not in proportion: what a long lag takes from the input hardly grows
with its time constant. So the size of least squares is sought in steps of one per cent, and its error is that
of the column by which the torque changes with the logarithm of the size.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EffectEntry
from haptic_teleop_sim.model import Model

from .groups import Chosen, Search
from .motion import BandedMotion
from .terms import Hypothesis, of_actuator

FloatArray = NDArray[np.float64]

#: Factor from one size to the next; steps, in such sizes, in which the best one is approached, and how often
#: at most it is moved by the longest.
_RATIO = 1.01
_STEPS, _MOST_LONG = (16, 6, 2, 1), 8
#: How near to its value the factor of a column is held that is evaluated at its size.
_HELD = 1e-9
#: Sizes on either side, between which the slope of a torque is taken.
_NEAR = 2


@dataclass(frozen=True, eq=False)
class Sized(Hypothesis):
    """An effect at the size that the equations want; ``ends``: whether they want one that is not admitted."""

    ends: bool = False

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """See `Term.bounds`."""
        return np.array([1.0 - _HELD]), np.array([1.0 + _HELD])

    def ends_at_bound(self, factors: FloatArray) -> bool:
        """See `Hypothesis.ends_at_bound`."""
        return self.ends


@dataclass(frozen=True, eq=False)
class Slope:
    """By how much (N·m) an effect's torque changes with the logarithm of its size: from two sizes that are
    ``steps`` of the grid apart."""

    below: Hypothesis
    above: Hypothesis
    steps: int

    @property
    def place(self) -> str:
        """See `Term.place`."""
        return self.below.place

    def columns(self, motion: BandedMotion, model: Model) -> FloatArray:
        """See `Term.columns`."""
        apart = self.steps * math.log(_RATIO)
        return (self.above.columns(motion, model) - self.below.columns(motion, model)) / apart

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """See `Term.bounds`."""
        return np.array([-np.inf]), np.array([np.inf])


def slope_of(one: Sized) -> Slope:
    """The slope of an effect at its size."""
    number = _number_of(dict(one.shape)[one.sizes[0]])
    near = [n for n in range(number - _NEAR, number + _NEAR + 1) if _in_range(one, n)]
    return Slope(_at(one, near[0]), _at(one, near[-1]), near[-1] - near[0])


class ExactSizes:
    """Finds the sizes of groups. ``admitted``: whether an effect may have a size."""

    def __init__(self, search: Search, admitted: Callable[[Hypothesis], bool]) -> None:
        self._search, self._admitted = search, admitted
        self._known: dict[tuple[EffectEntry, int], tuple[Sized, bool]] = {}

    def __call__(self, chosen: Chosen) -> Chosen:
        """The group with its effect of the actuator at the size that leaves least; as it is where none or two
        are there, and where it has a further parameter, which stays on a grid."""
        places = [i for i, h in enumerate(chosen) if of_actuator(h)]
        if len(places) != 1 or len(chosen[places[0]].shape) != 1:
            return chosen
        (place,) = places
        one = chosen[place]

        def group(number: int) -> Chosen:
            return (*chosen[:place], self._sized(one, number)[0], *chosen[place + 1 :])

        def left(number: int) -> float:
            return self._search.left_over(group(number)) if self._sized(one, number)[1] else math.inf

        best = _number_of(dict(one.shape)[one.sizes[0]])
        for step in _STEPS:
            for _ in range(_MOST_LONG):
                nearer = min((best, best - step, best + step), key=left)
                if nearer == best:
                    break
                best = nearer
        if not math.isfinite(left(best)):
            return chosen
        ends = not (self._sized(one, best - 1)[1] and self._sized(one, best + 1)[1])
        found = group(best)
        if not ends:
            return found
        return (*chosen[:place], _at(one, best, ends=True), *chosen[place + 1 :])

    def _sized(self, one: Hypothesis, number: int) -> tuple[Sized, bool]:
        """The effect at a size, and whether it is admitted."""
        key = one.entry, number
        if key not in self._known:
            found = _at(one, number)
            self._known[key] = found, _in_range(one, number) and self._admitted(found)
        return self._known[key]


def _number_of(size: float) -> int:
    return round(math.log(size) / math.log(_RATIO))


def _in_range(one: Hypothesis, number: int) -> bool:
    """Whether the size lies within the range of its parameter."""
    return one.entry.parameter(one.sizes[0]).within(_RATIO**number) == _RATIO**number


def _at(one: Hypothesis, number: int, ends: bool = False) -> Sized:
    shape = ((one.sizes[0], _RATIO**number),)
    return Sized(one.entry, one.location, one.place, shape, one.sizes, None, one.gives, True, ends)
