"""At which place of a flexible joint what is missing acts, whatever it is (see `inverse_dynamics.parity`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from ..hypotheses.candidates import dry_friction
from ..policy import FITS_WORSE, HOLDS_BETTER, MISFIT, NOT_LOWERED
from .inverse_dynamics.corrected import can_correct, corrected
from .inverse_dynamics.parity import parity_residuals
from .inverse_dynamics.parity_equations import ARM, ARM_ENCODER, ENCODERS, JOINT, MOTOR
from .inverse_dynamics.parity_signals import acts_at, can_allow_for


@dataclass(frozen=True)
class ActingPlace:
    """Asks the parity equations of all ``records`` of a flexible joint; ``cutoff``: Hz, of the motion's
    band. The effects of ``model`` and ``beside`` are allowed for."""

    model: Model
    records: Sequence[Record]
    cutoff: float
    beside: tuple[Effect, ...] = ()
    _known: dict[Any, dict[str, float]] = field(default_factory=dict, compare=False, repr=False)

    @staticmethod
    def of(model: Model, records: Sequence[Record], cutoff: float) -> ActingPlace | None:
        """None where equations say nothing: of a rigid joint, one whose arm nobody read, or a model with an
        effect that they cannot allow for."""
        read = ActingPlace.read(records)
        if model.rigid or not read or not all(can_allow_for(e.entry) for e in model.effects):
            return None
        return ActingPlace(model, read, cutoff)

    @staticmethod
    def read(records: Sequence[Record]) -> list[Record]:
        """The records on which somebody read the arm."""
        return [r for r in records if np.any(np.isfinite(r.measured[:, 1]))]

    def rubs(self, effects: Iterable[Effect]) -> bool:
        """Whether one of some effects, or of the model's own, is a friction at the motor."""
        every = (*self.model.effects, *effects)
        return any(e.entry.kind == "friction" and e.location == self.model.location(MOTOR) for e in every)

    def left(
        self, known: Sequence[Effect] = (), encoders: Sequence[str] = ENCODERS, sliding: Sequence[Effect] = ()
    ) -> dict[str, float]:
        """What each place's equation leaves beside some effects (see `parity_residuals`); empty where the
        arithmetic fails."""
        every = (*self.model.effects, *self.beside, *known)
        asked = (*map(_key, every),), encoders, (*map(_key, sliding),)
        if asked not in self._known:
            try:
                found = parity_residuals(self.model, self.records, self.cutoff, every, encoders, sliding)
            except FAILURES:
                found = {}
            self._known[asked] = found
        return self._known[asked]

    def clear_beside(self, names: Sequence[Effect]) -> ActingPlace:
        """The same beside the fewest of ``names``, or else beside dry friction at the motor, where some
        equations then hold and others do not; unchanged where that is so of none. Every drive has friction,
        and it is in all equations but the arm's."""
        asked = [*filter(_asked, names)]
        sets = [beside for n in range(len(asked) + 1) for beside in combinations(asked, n)]
        if not self.rubs(names):
            sets.append((self.dry_friction,))
        tried = (replace(self, beside=(*self.beside, *beside)) for beside in sets)
        return next((one for one in tried if one.places), self)

    @property
    def dry_friction(self) -> Effect:
        """At the motor, of a size that says nothing."""
        return dry_friction(self.model)

    @cached_property
    def places(self) -> tuple[str, ...]:
        """The places of which one is that of all that is missing, best first: their equations hold, and those
        of the others do not. Mostly it is one; a slow error of an encoder is one of the joint, too. Empty
        where there are none, where the motor is among them, as some random torque acts on every machine, and
        where the arm is not the only one: the arm's acceleration, noisy as it is, is in the equations of
        motor and joint alone."""
        if not all(self._may_be_elsewhere(self.left(encoders=asked)) for asked in ((), ENCODERS)):
            return ()
        ordered = sorted(self.bare, key=lambda place: self.bare[place])
        for number, (worst, other) in enumerate(pairwise(ordered), 1):
            if self.bare[other] > max(HOLDS_BETTER * self.bare[worst], MISFIT):
                holding = ordered[:number]
                open_to_noise = number > 1 and ARM in holding
                return () if MOTOR in holding or open_to_noise else tuple(holding)
        return ()

    @staticmethod
    def _may_be_elsewhere(left: Mapping[str, float]) -> bool:
        """Whether the motor's equation does not hold, so that more of them could show another place."""
        return bool(left) and left[MOTOR] > MISFIT

    def elsewhere(self, effect: Effect) -> bool:
        """Whether everything acts at one of some places, and an effect is a torque that acts at another one:
        it does not lower what the best of their equations leaves. One that acts at moments is not asked."""
        if effect in self.beside or not self.places or not _asked(effect):
            return False
        if acts_at(self.model, effect.location) in self.places:
            return False
        best = self.places[0]
        wanted = ENCODERS if best in ENCODERS else ()
        left, before = (self.left(known, wanted, [effect]).get(best) for known in ([effect], []))
        return left is not None and before is not None and left > NOT_LOWERED * before

    def held_worse(self, error: Effect, beside: Sequence[Effect]) -> str | None:
        """The place whose equation leaves clearly more once ``error`` of an encoder is taken from the
        readings than before, ``beside`` other effects: an encoder that errs does so in each equation with its
        angle, and none of them may get worse without. None where there is none. Errors among the others are
        taken out of both. The spring may be any: beside a torque constant that is off, that of the model
        makes an equation hold best with readings that err."""
        if not self._of_readings(error):
            return None
        model = replace(self.model, fixed=tuple(n for n in self.model.fixed if n != "stiffness"))
        others = [*self.records]
        for one in filter(self._of_readings, beside):
            others = [corrected(r, one, self._channel(one)) for r in others]
        true = [corrected(r, error, self._channel(error)) for r in others]
        known = [*filter(_asked, beside)]
        before, after = (
            replace(self, model=model, records=read, _known={}).left(known, ()) for read in (others, true)
        )
        worse = {place: after[place] / max(before[place], 1e-300) for place in before if place in after}
        most = max(worse, key=lambda place: worse[place], default=None)
        return most if most is not None and worse[most] > FITS_WORSE else None

    def _of_readings(self, effect: Effect) -> bool:
        """Whether an effect is an error of an encoder that can be taken out of its readings."""
        return self.model.place(effect.location) in ENCODERS and can_correct(effect)

    def _channel(self, error: Effect) -> int:
        return int(self.model.place(error.location) == ARM_ENCODER)

    def explained(self, names: Sequence[Effect]) -> float:
        """Share (mean square) of what the equations of other places leave that they do not leave with names,
        where everything, but for some of these (`clear_beside`), acts at one of some places; 1 where that is
        not so, or a name cannot be asked."""
        places = self.clear_beside(names).places
        if not places or not all(map(_asked, names)):
            return 1.0
        others = [place for place in (MOTOR, ARM, JOINT) if place not in places]
        left, bare = (self.left(known, (), names) for known in (names, ()))
        after = min((left[place] for place in others if place in left), default=0.0)
        before = min((bare[place] for place in others if place in bare), default=1.0)
        return 1.0 if after < MISFIT else 1.0 - min(after / before, 1.0) ** 2

    @cached_property
    def bare(self) -> dict[str, float]:
        """`left` beside no other effect."""
        return self.left()

    @cached_property
    def quick(self) -> dict[str, float]:
        """`bare` of the equations with both encoders: those without one take several times as long to ask."""
        return self.left(encoders=())

    def content(self, whole: bool) -> dict[str, Any]:
        """What diagnosis.json says: what is allowed for, and what each place's equation leaves; with the
        ``whole``, those without an encoder, too."""
        told = self.bare if whole else self.quick
        return {
            "beside": [f"{e.effect} at {e.location}" for e in self.beside],
            "left": {self.model.location(place): round(left, 5) for place, left in told.items()},
        }


def _key(effect: Effect) -> tuple[Any, ...]:
    return effect.effect, effect.location, *sorted(effect.parameters.items())


def _asked(effect: Effect) -> bool:
    return can_allow_for(effect.entry) and not effect.entry.momentary
