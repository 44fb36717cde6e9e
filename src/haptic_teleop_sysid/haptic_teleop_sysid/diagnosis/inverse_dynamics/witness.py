"""What the inverse dynamics say: which effects, as torques along the motion, explain the input."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from ..candidates import family
from ..scales import Scales
from .latent import Latent, latents
from .motion import motion_band
from .regression import Equations, Fold, equations, solved, standard_errors, weights_of
from .terms import Hypothesis, hypotheses

FloatArray = NDArray[np.float64]
Chosen = tuple[Hypothesis, ...]
Terms = tuple[Hypothesis | Latent, ...]

#: How many of the best are tried in pairs, and how many groups of each number of effects are kept.
MOST_PAIRED, BEAM = 12, 8
#: Log-likelihood that a parameter must gain, both ways together.
A_PARAMETER = 4.0
#: Share of what the structure alone leaves (mean square) that no equation of an effect comes nearer to: dry
#: friction is never quite that, and what a richer form gains below it says nothing.
FORM = 0.005
#: Weight that keeps a torque without a form straight, relative to the best visited knot.
STIFF = 0.05
#: Log-likelihood by which a torque without a form must exceed an effect to speak against it.
CLEARLY = 12.0
#: Share of an effect's torque (mean square) up to which one without a form may miss its shape.
SHAPED = 0.2
#: Torques without a form that together say what could be explained.
MOST_SHAPELESS = 2


@dataclass(frozen=True)
class Group:
    """Effects that the inverse dynamics name together.

    ``model``: the structure's parameters and the effects, fitted to the estimation recordings; ``gain``:
    log-likelihood gained on recordings that were not fitted, over the structure alone, both ways (fitted to
    the ones and judged by the others, and the other way round), at the number of samples that are
    independent; ``percent``: torque fit of the validation recordings, 100 (1 - rms left / rms about the
    mean); ``explained``: share of what the structure alone leaves that the effects explain, as in
    `Witness.recoverable`; ``std``: standard errors by parameter of the regression, with what the
    recordings of either kind put them apart.
    """

    model: Model
    hypotheses: tuple[Hypothesis, ...]
    gain: float
    percent: float
    explained: float
    std: dict[str, float]

    @property
    def effects(self) -> tuple[Effect, ...]:
        count = len(self.hypotheses)
        return self.model.effects[-count:] if count else ()


@dataclass(frozen=True)
class Witness:
    """``structure``: without any effect; ``levels``: groups of one effect, of two and of three, best first,
    BEAM of each at most; ``cutoff``: Hz.

    ``recoverable``: share of what the structure alone leaves of the torques (mean square, stretches of all
    recordings that were not fitted, because these torques say nothing of where they were not) that torques
    without a form explain, at most MOST_SHAPELESS of them, or the best group:
    what any explanation could reach; ``shapeless``: these torques; ``folds``
    answers further questions on such stretches."""

    structure: Group
    levels: tuple[tuple[Group, ...], ...]
    cutoff: float
    recoverable: float
    shapeless: tuple[Latent, ...]
    folds: Search

    def beside(self, group: Group) -> tuple[Latent, float] | None:
        """The torque without a form that explains most of what a group leaves, and the share of that."""
        more = self.folds.shapeless(group.hypotheses, 1)
        if not more:
            return None
        left = [1.0 - self.folds.explained(terms) for terms in (group.hypotheses, (*group.hypotheses, *more))]
        return more[0], 1.0 - left[1] / max(left[0], 1e-300)


def witness(
    model: Model,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    cutoff: float | None = None,
) -> Witness:
    """Search the groups of effects that explain the input of both kinds of recordings."""
    cutoff = motion_band([*estimation, *validation]) if cutoff is None else cutoff
    search = Search(model, equations(model, estimation, cutoff), equations(model, validation, cutoff))
    every = list(hypotheses(model, scales))
    singles = search.best_of_each(every, ())
    # Two that hide each other: neither need be the best by itself, or be seen by itself at all.
    tops = [chosen[0] for chosen in singles[:MOST_PAIRED]]
    pairs = [pair for pair in itertools.combinations(tops, 2) if _different(*pair)]
    known = {frozenset(pair) for pair in pairs}
    more = search.best_of_each(every, singles[0]) if singles else []
    pairs += [pair for pair in more if frozenset(pair) not in known]
    levels: list[list[Chosen]] = [[()], singles, pairs]
    if pairs:
        levels.append(search.best_of_each(every, search.leader(pairs)))
    return search.weighed([level for level in levels if level], cutoff)


def _different(one: Hypothesis, other: Hypothesis) -> bool:
    return one.location != other.location or other.entry.name not in family(one.entry.name)


class Search:
    """Groups of hypotheses on the equations of both kinds of recordings."""

    def __init__(self, model: Model, here: Equations | Fold, there: Equations | Fold):
        self.model, self.sides = model, (here, there)
        count = 1 if model.rigid else 2
        self.weights = [weights_of(s.target, s.base, count) for s in self.sides]
        self.known: dict[Hypothesis | Latent, tuple[FloatArray, FloatArray]] = {}
        self.numbers = [1.0, 1.0]
        self.cached: dict[Terms, tuple[float, float]] = {}

    def best_of_each(self, every: Sequence[Hypothesis], beside: Chosen) -> list[Chosen]:
        """``beside`` and one further hypothesis: of each effect at each place the one that leaves least, the
        least first."""
        best: dict[tuple[str, str], tuple[float, Chosen]] = {}
        for one in every:
            if not all(_different(one, other) for other in beside):
                continue
            chosen = (*beside, one)
            key, left = (one.entry.name, one.location), self.left_over(chosen)
            if key not in best or left < best[key][0]:
                best[key] = (left, chosen)
        return [chosen for _, chosen in sorted(best.values(), key=lambda b: b[0])]

    def leader(self, level: Sequence[Chosen]) -> Chosen:
        """The one that leaves least."""
        return min(level, key=self.left_over)

    def left_over(self, chosen: Terms) -> float:
        """Sum over both kinds of recordings of rows times the logarithm of what is left there by parameters
        fitted to the other kind, relative to what the structure alone leaves."""
        return sum(s.samples * r for s, r in zip(self.sides, self.ratios(chosen), strict=True))

    def ratios(self, chosen: Terms) -> tuple[float, float]:
        if chosen not in self.cached:
            found = []
            for judged in (0, 1):
                before = self._left(judged, (), self._fitted(1 - judged, ()))
                after = self._left(judged, chosen, self._fitted(1 - judged, chosen))
                whole = float(before @ before)
                found.append(math.log((float(after @ after) + FORM * whole) / ((1.0 + FORM) * whole)))
            self.cached[chosen] = (found[0], found[1])
        return self.cached[chosen]

    def weighed(self, levels: Sequence[Sequence[Chosen]], cutoff: float) -> Witness:
        """The best group of each number of effects, as far as each number gains enough over fewer."""
        # What the fullest explanation leaves comes nearest to noise: how long that remembers says how many
        # samples count, and for all groups the same number.
        fullest = self.leader([chosen for level in levels for chosen in level])
        self.numbers = numbers = [
            independent(self._left(k, fullest, self._fitted(1 - k, fullest))[: side.samples])
            for k, side in enumerate(self.sides)
        ]

        def gain(chosen: Chosen) -> float:
            return self.likelier(chosen) - A_PARAMETER * sum(h.parameters for h in chosen)

        def ranked(level: Sequence[Chosen]) -> tuple[Group, ...]:
            best = sorted(level, key=gain, reverse=True)[:BEAM]
            return tuple(self.group(chosen, gain(chosen), numbers) for chosen in best)

        found = tuple(ranked(level) for level in levels[1:])
        whole = tuple(side for side in self.sides if isinstance(side, Equations))
        folds = Search(self.model, Fold(whole, False), Fold(whole, True))
        folds.numbers = [0.5 * sum(numbers)] * 2
        shapeless = folds.shapeless(())
        best = [level[0].hypotheses for level in found]
        most = max(folds.explained(terms) for terms in (shapeless, *best))
        return Witness(self.group((), 0.0, numbers), found, cutoff, most, shapeless, folds)

    def adequacies(self, chosen: Chosen) -> list[float]:
        """For each effect of a group, how much of what a torque without a form explains in the same
        quantities, at the same place, it does, 0 to 1; 1 where none explains clearly more.

        A torque without a form has the quantities of an effect where it can take on the effect's shape."""
        found = []
        for one in chosen:
            rest = tuple(h for h in chosen if h is not one)
            none, own = self.explained(rest), self.explained(chosen) - self.explained(rest)
            clearer = [
                wider
                for latent in self.alike(one)
                if self.likelier(wider := (*rest, latent)) > self.likelier(chosen) + CLEARLY
            ]
            most = max([self.explained(wider) - none for wider in clearer], default=own)
            found.append(min(max(own, 0.0) / most, 1.0) if most > 0.0 else 1.0)
        return found

    def likelier(self, chosen: Terms) -> float:
        """Log-likelihood gained on recordings that were not fitted, at the number of independent samples."""
        return -0.5 * sum(n * r for n, r in zip(self.numbers, self.ratios(chosen), strict=True))

    def alike(self, hypothesis: Hypothesis) -> list[Latent]:
        """Torques without a form, at the same place, that can take on the shape of an effect."""
        torque = self._columns(hypothesis)[0] * self.weights[0][:, None]
        found = []
        for latent in self.latents:
            if latent.place != hypothesis.place:
                continue
            columns = self._columns(latent)[0] * self.weights[0][:, None]
            left = torque - columns @ np.linalg.lstsq(columns, torque, rcond=1e-8)[0]
            if float(np.sum(left**2)) < SHAPED * float(np.sum(torque**2)):
                found.append(latent)
        return found

    def explained(self, chosen: Terms) -> float:
        """Share of what the structure alone leaves that is explained on recordings that were not fitted."""
        rows = sum(side.samples for side in self.sides)
        return 1.0 - float(np.exp(self.left_over(chosen) / rows))

    @cached_property
    def latents(self) -> tuple[Latent, ...]:
        """Every torque without a form."""
        return tuple(latents(self.model, [m for side in self.sides for m in side.motions]))

    def shapeless(self, beside: Chosen, most: int = MOST_SHAPELESS) -> tuple[Latent, ...]:
        """Up to ``most`` torques without a form, as long as each explains more, beside some effects."""
        found: tuple[Latent, ...] = ()
        for _ in range(most):
            wider = min(
                ((*found, one) for one in self.latents if one not in found),
                key=lambda terms: self.left_over((*beside, *terms)),
            )
            if not self.left_over((*beside, *wider)) < self.left_over((*beside, *found)):
                break
            found = wider
        return found

    def group(self, chosen: Chosen, gain: float, numbers: Sequence[float]) -> Group:
        side, values = self.sides[0], self._fitted(0, chosen)
        left = self._left(0, chosen, values)
        columns = self._all(0, chosen) * self.weights[0][:, None]
        lags = max(1, round(side.samples / max(numbers[0], 1.0)))
        # Half the squared difference is the variance of either, if they have the same.
        apart = (values - self._fitted(1, chosen)) / math.sqrt(2.0)
        errors = np.hypot(standard_errors(columns, left, lags), apart)
        arm = side.arm_scale(values)
        found, std = {}, {}
        for i, name in enumerate(side.names):
            scale = arm if name.startswith("arm") else 1.0
            found[name], std[name] = max(scale * float(values[i]), 1e-12), scale * float(errors[i])
        effects, place = [], len(side.names)
        for h in chosen:
            own = slice(place, place := place + len(h.bounds()[0]))
            scale = arm if h.place == "arm" else 1.0
            effects.append(h.effect(scale * values[own]))
            of = h.errors(scale * values[own], scale * errors[own])
            std |= {f"{h.location}.{h.entry.name}.{n}": e for n, e in of.items()}
        model = replace(self.model.with_values(found), effects=(*self.model.effects, *effects))
        y, there = self.sides[1].target * self.weights[1], self._left(1, chosen, self._fitted(0, chosen))
        percent = 100.0 * (1.0 - float(np.linalg.norm(there) / max(np.linalg.norm(y - y.mean()), 1e-300)))
        return Group(model, chosen, gain, percent, self.explained(chosen), std)

    def _all(self, side: int, chosen: Terms) -> FloatArray:
        return np.column_stack([self.sides[side].base, *(self._columns(h)[side] for h in chosen)])

    def _columns(self, term: Hypothesis | Latent) -> tuple[FloatArray, FloatArray]:
        if term not in self.known:
            here, there = self.sides
            self.known[term] = here.columns(term), there.columns(term)
        return self.known[term]

    def _fitted(self, side: int, chosen: Terms) -> FloatArray:
        weight = self.weights[side]
        bounds = [h.bounds() for h in chosen]
        own = self.sides[side].bounds()
        low = np.concatenate([own[0], *(b[0] for b in bounds)])
        high = np.concatenate([own[1], *(b[1] for b in bounds)])
        columns = self._all(side, chosen) * weight[:, None]
        target = self.sides[side].target * weight
        stiff = self._stiff(columns, chosen)
        columns = np.concatenate([columns, *stiff])
        target = np.concatenate([target, np.zeros(len(columns) - len(target))])
        return solved(columns, target, low, high)

    def _stiff(self, columns: FloatArray, chosen: Terms) -> list[FloatArray]:
        """Rows (r, p) that keep torques without a form from bending where the motion hardly goes."""
        found, place = [], columns.shape[1] - sum(len(h.bounds()[0]) for h in chosen)
        for h in chosen:
            own = slice(place, place := place + len(h.bounds()[0]))
            if isinstance(h, Latent):
                bends = h.bends()
                rows = np.zeros((len(bends), columns.shape[1]))
                rows[:, own] = STIFF * float(np.max(np.linalg.norm(columns[:, own], axis=0))) * bends
                found.append(rows)
        return found

    def _left(self, side: int, chosen: Terms, values: FloatArray) -> FloatArray:
        return (self.sides[side].target - self._all(side, chosen) @ values) * self.weights[side]


def independent(left: FloatArray) -> float:
    """How many of the samples (n,) say something that their neighbours do not: n over the sum of their
    autocorrelations, up to the first that is none."""
    e, n = left - left.mean(), len(left)
    size = 1 << (2 * n - 1).bit_length()
    power = np.abs(np.fft.rfft(e, size)) ** 2
    correlation = np.fft.irfft(power, size)[: max(n // 4, 2)]
    correlation = correlation / max(float(correlation[0]), 1e-300)
    first = int(np.argmax(correlation < 0.05)) or len(correlation)
    return n / (1.0 + 2.0 * float(np.sum(correlation[1:first])))
