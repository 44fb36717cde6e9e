"""At which place of a flexible joint what is missing acts, whatever it is (see `inverse_dynamics.parity`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from ..policy import HOLDS_ALONE, MISFIT, NOT_LOWERED
from .inverse_dynamics.parity import ARM, JOINT, MOTOR, parity_residuals, told


@dataclass(frozen=True)
class ActingPlace:
    """Asks the parity equations of all ``records`` of a flexible joint; ``cutoff``: Hz, of the motion's
    band. The effects of ``model`` are allowed for."""

    model: Model
    records: Sequence[Record]
    cutoff: float

    def left(self, known: Sequence[Effect] = ()) -> dict[str, float]:
        """What each place's equation leaves beside some effects (see `parity_residuals`)."""
        return parity_residuals(self.model, self.records, self.cutoff, [*self.model.effects, *known])

    @cached_property
    def alone(self) -> str | None:
        """The place whose equation holds while no other does; None where there is none, and at the motor,
        where some random torque acts on every machine."""
        (best, least), (_, next_best), *_ = sorted(self._left.items(), key=lambda one: one[1])
        clear = next_best > max(HOLDS_ALONE * least, MISFIT)
        return best if clear and best != MOTOR else None

    def elsewhere(self, effect: Effect) -> bool:
        """Whether everything acts at one place, and an effect is a torque that acts at another one: it does
        not lower what the equation of that place leaves. One that acts at moments is not asked."""
        if self.alone is None or self.place(effect) == self.alone or not _asked(effect):
            return False
        return self.left([effect])[self.alone] > NOT_LOWERED * self._left[self.alone]

    def explained(self, names: Sequence[Effect]) -> float:
        """Share (mean square) of what the equations of other places leave that they do not leave with names,
        where everything acts at one place; 1 where that is not so, or a name there cannot be asked."""
        if self.alone is None or any(self.place(e) == self.alone and not _asked(e) for e in names):
            return 1.0
        before, after = (
            min(left[place] for place in (MOTOR, ARM, JOINT) if place != self.alone)
            for left in (self._left, self.left(names))
        )
        return 1.0 if after < MISFIT else 1.0 - min(after / before, 1.0) ** 2

    def place(self, effect: Effect) -> str:
        """Where an effect enters the equations: what an actuator makes of its input is a torque at the
        motor."""
        place = self.model.place(effect.location)
        return MOTOR if place == "actuator" else place

    @cached_property
    def _left(self) -> dict[str, float]:
        return self.left()


def _asked(effect: Effect) -> bool:
    return told(effect.entry) and not effect.entry.momentary
