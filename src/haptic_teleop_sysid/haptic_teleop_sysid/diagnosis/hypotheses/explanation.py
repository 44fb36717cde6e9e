"""An explanation: a model with one more effect, and what speaks for it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit

#: Nats that a parameter gains by chance, and one that was sought over a whole scale (an order, a frequency,
#: a place): the best of many values fits noise better than a single one.
_BY_CHANCE, _SOUGHT = 2.0, 4.0


@dataclass(frozen=True)
class Explanation:
    """A model with one more effect, fitted to the estimation recordings.

    ``gain``: nats it is better there than the model without the effect; ``held_out``: the same on the
    validation recordings, the model kept as it was fitted; ``material``: see ``material.py``;
    ``effect_index``: which of the model's effects it is.  ``reconciled``: what both gain further when the
    parameters may lie between, beyond what the model without the effect gains so (see
    `held_out.reconciled`).  ``by_current``: how many of these nats (both kinds)
    the measured current gives; ``std``: uncertainty of a parameter that the current determined; ``beside``:
    an effect of the recorded current alone, which the model, driven by the command, has no need of;
    ``grounds``: what speaks for it in words, where it was not likelihoods that found it. ``gains``: what
    it gains in each block of both kinds of recordings, (recordings, blocks), None where that is not known.
    """

    fit: Fit
    gain: float
    held_out: float
    material: bool
    effect_index: int
    reconciled: float = 0.0
    by_current: float = 0.0
    std: dict[str, float] = field(default_factory=dict)
    beside: Effect | None = None
    grounds: str | None = None
    gains: NDArray[np.float64] | None = field(default=None, compare=False, repr=False)

    @property
    def effect(self) -> Effect:
        return self.fit.model.effects[self.effect_index] if self.beside is None else self.beside

    @property
    def elsewhere(self) -> float:
        """Nats that the effect gains beyond the recordings it was fitted to, when the parameters may lie
        between what either kind of recordings wants."""
        return self.held_out + self.reconciled

    @property
    def score(self) -> float:
        """Nats in all, less what further parameters gain by chance on data they were fitted to."""
        return self.gain + self.elsewhere - by_chance(self.effect)

    @property
    def by_motion(self) -> float:
        """The score without what the measured current gives."""
        return self.score - self.by_current


def by_chance(effect: Effect) -> float:
    """Nats that an effect's parameters gain by chance on data they were fitted to."""
    # A delay counts as one number, although it was sought: its other name, of which it is told by nothing
    # else, was not, and would win by what that is charged.
    sought = {p.name for p in effect.entry.parameters if p.scan not in ("", "delay")}
    return sum(_SOUGHT if name in sought else _BY_CHANCE for name in effect.parameters)
