"""Groups of hypotheses on the equations of two sides, each fitted to the one and judged by the other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.correlation import autocorrelation

from ...hypotheses.candidates import family
from .folds import Fold
from .latent import Latent, latents
from .products import Products, Terms
from .regression import Equations
from .term import Term
from .terms import Hypothesis, of_actuator

FloatArray = NDArray[np.float64]
Chosen = tuple[Hypothesis, ...]

#: Share of what the structure alone leaves (mean square) that no equation of an effect comes nearer to: dry
#: friction is never quite that, and what a richer form gains below it says nothing.
FORM = 0.005
#: Log-likelihood by which a free curve must exceed an effect to speak against it.
CLEARLY = 12.0
#: Share of an effect's torque (mean square) up to which a free curve may miss its shape.
SHAPED = 0.2
#: Change of an effect's torque over a recording, relative to it, up to which it is one and the same.
STEADY = 1e-6
#: Share of an effect's torque (mean square) that nothing else of its group may give. Of right names on real
#: machines at least 0.02, of those that say the same as others 0.002 or less.
LEAST_OWN = 0.01
#: Free curves that together say what could be explained.
MOST_FREE_CURVES = 2
#: The parameter that multiplies the motor's acceleration.
INERTIA = "motor_inertia"


def different(one: Hypothesis, other: Hypothesis) -> bool:
    """Whether two hypotheses are no two forms of one effect at one place."""
    return one.location != other.location or other.entry.name not in family(one.entry.name)


class Search:
    """Groups of hypotheses on the equations of two sides: the two kinds of recordings, or two folds."""

    def __init__(self, model: Model, here: Equations | Fold, there: Equations | Fold) -> None:
        self.model, self.sides = model, (Products(here), Products(there))
        #: How many samples of each side say something that their neighbours do not.
        self.numbers = (1.0, 1.0)
        self._ratios: dict[Terms, tuple[float, float]] = {}
        self._fitted: dict[tuple[int, Terms], FloatArray] = {}

    def fitted(self, side: int, terms: Terms) -> FloatArray:
        """Parameters (p,) of a group on one side."""
        if (side, terms) not in self._fitted:
            self._fitted[side, terms] = self.sides[side].fitted(terms)
        return self._fitted[side, terms]

    def ratios(self, terms: Terms) -> tuple[float, float]:
        """Logarithm, for each side, of what is left there by parameters fitted to the other one, relative to
        what the structure alone leaves.

        An actuator that passes hardly anything would explain everything, with an inertia that falls as much.
        But the density of a motion is that of its torques times the inertia at every sample: what is left is
        multiplied by how much that falls, squared (`_shrinks`)."""
        if terms not in self._ratios:
            found = []
            for judged, side in enumerate(self.sides):
                whole = self._structure_leaves[judged]
                left = side.square_left(terms, self.fitted(1 - judged, terms))
                left *= self._shrinks(1 - judged, terms)
                found.append(math.log((left + FORM * whole) / max((1.0 + FORM) * whole, 1e-300)))
            self._ratios[terms] = (found[0], found[1])
        return self._ratios[terms]

    def _shrinks(self, side: int, terms: Terms) -> float:
        """Factor, 1 at least, by which the inertia on one side, squared, falls by what the actuator makes of
        the input: from the given one, or from that of the equations without, if that is less."""
        rest = tuple(t for t in terms if not of_actuator(t))
        names = self.sides[side].side.names
        if len(rest) == len(terms) or INERTIA not in names:
            return 1.0
        own, without = (float(self.fitted(side, one)[names.index(INERTIA)]) for one in (terms, rest))
        falls = min(without, self.model.parameters[INERTIA]) / max(own, 1e-300)
        return max(falls, 1.0) ** 2

    @cached_property
    def _structure_leaves(self) -> list[float]:
        """What the structure alone leaves on each side, fitted to the other (`Products.square_left`)."""
        return [s.square_left((), self.fitted(1 - k, ())) for k, s in enumerate(self.sides)]

    def left_over(self, terms: Terms) -> float:
        """Sum over both sides of rows times the logarithm of what is left (`ratios`)."""
        return sum(s.samples * r for s, r in zip(self.sides, self.ratios(terms), strict=True))

    def explained(self, terms: Terms) -> float:
        """Share of what the structure alone leaves that is explained where it was not fitted."""
        rows = sum(side.samples for side in self.sides)
        return 1.0 - float(np.exp(self.left_over(terms) / rows))

    def likelier(self, terms: Terms) -> float:
        """Log-likelihood gained where it was not fitted, at the number of independent samples."""
        return -0.5 * sum(n * r for n, r in zip(self.numbers, self.ratios(terms), strict=True))

    def count(self, terms: Terms) -> None:
        """Take as many samples of each side as say something of their own in what a group leaves there."""
        left = [s.left(terms, self.fitted(1 - k, terms))[: s.samples] for k, s in enumerate(self.sides)]
        self.numbers = (independent(left[0]), independent(left[1]))

    def best_of_each(self, every: Sequence[Hypothesis], beside: Chosen) -> list[Chosen]:
        """``beside`` and one further hypothesis: of each effect at each place the one that leaves least, the
        least first; of an actuator a size that wants to be another one only where all do."""
        best: dict[tuple[str, str], tuple[bool, float, Chosen]] = {}
        for one in every:
            if not all(different(one, other) for other in beside):
                continue
            chosen = (*beside, one)
            key, left = (one.entry.name, one.location), self.left_over(chosen)
            ends = of_actuator(one) and one.ends_at_bound(self.fitted(0, chosen)[-1:])
            if key not in best or (ends, left) < best[key][:2]:
                best[key] = (ends, left, chosen)
        return [chosen for _, _, chosen in sorted(best.values(), key=lambda b: b[1])]

    def leader(self, level: Sequence[Chosen]) -> Chosen:
        """The one that leaves least."""
        return min(level, key=self.left_over)

    def told_apart(self, chosen: Chosen) -> bool:
        """Whether no effect's torque is one that the structure and the other effects of a group give, too, on
        one side at least (see `Products.own_shares`): a constant torque beside an input that does not change,
        or beside a friction of two sizes while the joint moves."""
        shares = (side.own_shares(chosen, self.fitted(k, chosen)) for k, side in enumerate(self.sides))
        return any(min(own, default=1.0) > LEAST_OWN for own in shares)

    def adequacies(self, chosen: Chosen) -> list[float]:
        """For each effect of a group, how much of what a free curve explains in the same
        quantities, at the same place, it does, 0 to 1; 1 where none explains clearly more.

        A free curve has the quantities of an effect where it can take on the effect's shape."""
        return [self.adequacy_beside(one, tuple(h for h in chosen if h is not one)) for one in chosen]

    def adequacy_beside(self, one: Hypothesis, rest: Terms) -> float:
        """The same of one effect, ``rest`` beside it."""
        chosen = (*rest, one)
        none, own = self.explained(rest), self.explained(chosen) - self.explained(rest)
        clearer = [
            wider
            for latent in self.alike(one)
            if self.likelier(wider := (*rest, latent)) > self.likelier(chosen) + CLEARLY
        ]
        most = max([self.explained(wider) - none for wider in clearer], default=own)
        return min(max(own, 0.0) / most, 1.0) if most > 0.0 else 1.0

    def alike(self, hypothesis: Hypothesis) -> list[Latent]:
        """Free curves, at the same place, that can take on the shape of an effect; none over time,
        which takes on any shape on a recording that is short, and none of an effect that is the same
        everywhere: any of them holds a constant, and what else it explains follows its quantity."""
        if self.same_everywhere(hypothesis):
            return []
        return [
            latent
            for latent in self.latents
            if latent.place == hypothesis.place
            and "time" not in latent.quantities
            and self.sides[0].unlike(hypothesis, latent) < SHAPED
        ]

    def same_everywhere(self, hypothesis: Hypothesis) -> bool:
        """Whether the effect's torque follows nothing: it has one size along all of the motion."""
        torques = (one.side.torque(hypothesis) for one in self.sides)
        return all(np.all(np.ptp(t, axis=0) <= STEADY * np.max(np.abs(t), axis=0)) for t in torques)

    @cached_property
    def latents(self) -> tuple[Latent, ...]:
        """Every free curve."""
        return tuple(latents(self.model, [m for side in self.sides for m in side.side.motions]))

    def forget(self, terms: Iterable[Term]) -> None:
        """Free what is kept of terms that are not asked for again: columns as long as the recordings."""
        gone = [*terms]
        for side in self.sides:
            side.forget(gone)

    def free_curves(self, beside: Chosen, most: int = MOST_FREE_CURVES) -> tuple[Latent, ...]:
        """Up to ``most`` free curves, as long as each explains more, beside some effects."""
        found: tuple[Latent, ...] = ()
        for _ in range(most):
            wider = min(
                ((*found, one) for one in self.latents if one not in found),
                key=lambda terms: self.left_over((*beside, *terms)),
                default=(),
            )
            if not wider or not self.left_over((*beside, *wider)) < self.left_over((*beside, *found)):
                break
            found = wider
        return found


def independent(left: FloatArray) -> float:
    """How many of the samples (n,) say something that their neighbours do not: n over the sum of their
    autocorrelations, up to the first that is none."""
    n = len(left)
    correlations = autocorrelation(left - left.mean(), max(n // 4, 2) - 1)
    first = int(np.argmax(correlations < 0.05)) or len(correlations)
    return n / (1.0 + 2.0 * float(np.sum(correlations[1:first])))
