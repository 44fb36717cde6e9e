"""Groups of effects that the inverse dynamics name, and what a search of them has found."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from haptic_teleop_sim.model import Effect, Model

from .exact_sizes import Sized, Slope, slope_of
from .groups import Chosen, Search
from .latent import Latent
from .regression import own_columns, standard_errors
from .terms import Hypothesis

#: Standard error of a structure's parameter, as a share of it, from which the estimation recordings leave it
#: open: a ramp says hardly anything of an inertia. By hand; 0.55 and 0.73 on two real joints whose free runs
#: of other recordings failed by it; of 189 parameters of the benchmark's machines, of cases that had failed,
#: 19 have more than 0.4, and half of them less than 0.02.
OPEN = 0.4
#: What stands for none of a parameter, as a damping is at its bound: that is not open.
NONE = 1e-12


@dataclass(frozen=True)
class Group:
    """Effects that the inverse dynamics name together.

    ``model``: the structure's parameters and the effects, fitted to the estimation recordings; ``gain``:
    log-likelihood gained on recordings that were not fitted, over the structure alone, both ways (fitted to
    the ones and judged by the others, and the other way round), at the number of samples that are
    independent; ``percent``: torque fit of the validation recordings, 100 (1 - rms left / rms about the
    mean); ``explained``: share of what the structure alone leaves that the effects explain, as in
    `SearchedGroups.recoverable`; ``std``: standard errors by parameter of the regression, with what the
    recordings of either kind put them apart; ``at_bound``: parameters of the structure that the regression
    wants beyond its bounds (no damping is none); ``settled``: those that the estimation recordings leave
    open, for which all are fitted to both kinds.
    """

    model: Model
    hypotheses: tuple[Hypothesis, ...]
    gain: float
    percent: float
    explained: float
    std: dict[str, float]
    at_bound: tuple[str, ...] = ()
    settled: tuple[str, ...] = ()

    @property
    def effects(self) -> tuple[Effect, ...]:
        count = len(self.hypotheses)
        return self.model.effects[-count:] if count else ()


@dataclass(frozen=True)
class SearchedGroups:
    """``structure``: without any effect; ``levels``: groups of one effect, of two and of three, best first,
    BEAM of each at most; ``cutoff``: Hz.

    ``recoverable``: share of what the structure alone leaves of the torques (mean square, stretches of all
    recordings that were not fitted, because these torques say nothing of where they were not) that free
    curves explain, at most MOST_FREE_CURVES of them, or the best group: what any explanation could
    reach; ``free_curves``: these torques; ``folds`` answers further questions on such stretches, and
    ``kinds`` on either kind of recordings."""

    structure: Group
    levels: tuple[tuple[Group, ...], ...]
    cutoff: float
    recoverable: float
    free_curves: tuple[Latent, ...]
    folds: Search
    kinds: Search

    @property
    def most_likely(self) -> Group | None:
        """The group of effects that gains most; None where there is none."""
        groups = (group for level in self.levels for group in level)
        return max(groups, key=lambda group: group.gain, default=None)

    def group_of(self, chosen: Chosen) -> Group:
        """These effects, and the structure beside them, fitted to the estimation recordings; what they gain
        is not asked."""
        return fitted_group(self.kinds, chosen, 0.0)

    def with_names(self, chosen: Chosen) -> Model:
        """The structure as the inverse dynamics have it beside these effects, and the effects."""
        return fitted_group(self.folds, chosen, 0.0).model

    def settling(self, group: Group) -> Group | None:
        """The group fitted to both kinds of recordings, where those of the estimation leave a parameter of
        the structure open; None where they do not."""
        values = group.model.parameters
        own = [n for n in self.kinds.sides[0].side.names if values[n] > NONE and n not in group.at_bound]
        left_open = tuple(n for n in own if group.std[n] > OPEN * values[n])
        if not left_open:
            return None
        both = fitted_group(self.folds, group.hypotheses, 0.0)
        return replace(group, model=both.model, at_bound=both.at_bound, settled=left_open)

    def beside(self, group: Group) -> tuple[Latent, float] | None:
        """The free curve that explains most of what a group leaves, and the share of that."""
        more = self.folds.free_curves(group.hypotheses, 1)
        if not more:
            return None
        left = [1.0 - self.folds.explained(terms) for terms in (group.hypotheses, (*group.hypotheses, *more))]
        return more[0], 1.0 - left[1] / max(left[0], 1e-300)


def fitted_effects(search: Search, chosen: Chosen) -> list[Effect]:
    """The effects of a group with their sizes, fitted to the first side's equations."""
    side, values = search.sides[0].side, search.fitted(0, chosen)
    arm = side.arm_scale(values)
    return [
        h.effect((arm if h.place == "arm" else 1.0) * values[own])
        for h, own in own_columns(side.names, chosen)
    ]


def fitted_group(search: Search, chosen: Chosen, gain: float) -> Group:
    """A group fitted to the first side's equations."""
    here, there = search.sides
    side, values = here.side, search.fitted(0, chosen)
    left = here.left(chosen, values)
    lags = max(1, round(here.samples / max(search.numbers[0], 1.0)))
    # Of a size that is exact the change of the torque with it counts, which each side wants another one of.
    sloped = tuple(slope_of(h) if isinstance(h, Sized) else h for h in chosen)
    wanted = search.fitted(1, chosen)
    more = tuple(h for h in sloped if isinstance(h, Slope))
    if more:
        both = search.fitted(1, (*chosen, *more))
        wanted = both[: len(values)].copy()
        exact = [own for h, own in own_columns(side.names, chosen) if isinstance(h, Sized)]
        for own, change in zip(exact, both[len(values) :], strict=True):
            wanted[own] = values[own] + change
    # Half the squared difference is the variance of either, if they have the same.
    apart = (values - wanted) / math.sqrt(2.0)
    errors = np.hypot(standard_errors(here.columns(sloped), left, lags), apart)
    arm = side.arm_scale(values)
    found, std = {}, {}
    for i, name in enumerate(side.names):
        scale = arm if name.startswith("arm") else 1.0
        found[name], std[name] = max(scale * float(values[i]), NONE), scale * float(errors[i])
    low, high = side.bounds()
    stuck = zip(side.names, values, low, high, strict=False)
    at_bound = tuple(n for n, v, a, b in stuck if v > 0.0 and min(v - a, b - v) < 1e-6 * v)
    for h, own in own_columns(side.names, chosen):
        scale = arm if h.place == "arm" else 1.0
        of = h.errors(scale * values[own], scale * errors[own])
        std |= {f"{h.location}.{h.entry.name}.{n}": e for n, e in of.items()}
    effects = fitted_effects(search, chosen)
    model = replace(search.model.with_values(found), effects=(*search.model.effects, *effects))
    target = there.target.ravel()
    missed = float(np.linalg.norm(there.left(chosen, values)))
    percent = 100.0 * (1.0 - missed / max(float(np.linalg.norm(target - target.mean())), 1e-300))
    return Group(model, chosen, gain, percent, search.explained(chosen), std, at_bound)
