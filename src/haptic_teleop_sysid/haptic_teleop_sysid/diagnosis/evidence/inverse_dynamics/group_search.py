"""What the inverse dynamics say: which effects, as torques along the motion, explain the input."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from ...hypotheses.admissible import admissible
from ...hypotheses.follows import is_lateness
from ...inputs.scales import Scales
from .band import motion_band
from .every_hypothesis import hypotheses
from .exact_sizes import ExactSizes, Sized, Slope, slope_of
from .folds import Fold
from .groups import Chosen, Search, different
from .latent import Latent
from .regression import equations, own_columns, standard_errors
from .terms import Hypothesis, of_actuator

#: How many groups of each number of effects are kept.
BEAM = 8
#: Pairs that are extended by a third effect, and thirds that all of them are tried with.
MOST_EXTENDED = 8
#: Share of the input torque, mean square in the band, that an actuator must leave: dry friction that carries
#: more of it looks like what takes as much of it away. And a lag or a delay, which friction does not look
#: like: one that filters nearly all of the input away leaves hardly anything to explain. By hand: at 0.1 a
#: lag of 1.9 s at a tendon-driven finger takes the place of friction and one of 0.28 s.
LEAST_ACTING, LEAST_LATER = 0.8, 0.3
#: Share of an effect's torque, mean square, that must lie in the band, on one kind of recordings at least:
#: of what lies outside, the band says nothing.
LEAST_SEEN = 0.25
#: Torque of an effect, rms, relative to that of the input, above which only something else that is missing
#: could hold it: two effects that cancel each other are a curve and not these two. At a resonance a spring's
#: torque is some times that of the input.
LARGEST = 4.0
#: Groups of each number of effects whose sizes are sought to the end.
MOST_SIZED = 2 * BEAM
#: Log-likelihood that a parameter must gain, both ways together.
A_PARAMETER = 4.0
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
    recordings that were not fitted, because these torques say nothing of where they were not) that torques
    without a form explain, at most MOST_FREE_CURVES of them, or the best group: what any explanation could
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
        return _group(self.kinds, chosen, 0.0)

    def with_names(self, chosen: Chosen) -> Model:
        """The structure as the inverse dynamics have it beside these effects, and the effects."""
        return _group(self.folds, chosen, 0.0).model

    def settling(self, group: Group) -> Group | None:
        """The group fitted to both kinds of recordings, where those of the estimation leave a parameter of
        the structure open; None where they do not."""
        values = group.model.parameters
        own = [n for n in self.kinds.sides[0].side.names if values[n] > NONE and n not in group.at_bound]
        left_open = tuple(n for n in own if group.std[n] > OPEN * values[n])
        if not left_open:
            return None
        both = _group(self.folds, group.hypotheses, 0.0)
        return replace(group, model=both.model, at_bound=both.at_bound, settled=left_open)

    def beside(self, group: Group) -> tuple[Latent, float] | None:
        """The free curve that explains most of what a group leaves, and the share of that."""
        more = self.folds.free_curves(group.hypotheses, 1)
        if not more:
            return None
        left = [1.0 - self.folds.explained(terms) for terms in (group.hypotheses, (*group.hypotheses, *more))]
        return more[0], 1.0 - left[1] / max(left[0], 1e-300)


def search_groups(
    model: Model,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    scales: Scales,
    cutoff: float | None = None,
) -> SearchedGroups:
    """Search the groups of effects that explain the input of both kinds of recordings.

    What is not admissible bars nothing that is: it leads no group and has no place among the best. A friction
    that is hardly asymmetric says the same as a plain one beside a constant torque, which then has to come
    up."""
    cutoff = motion_band([*estimation, *validation]) if cutoff is None else cutoff
    here, there = equations(model, estimation, cutoff), equations(model, validation, cutoff)
    search, driven = Search(model, here, there), here.driven
    sides = (here, there)

    def acts(h: Hypothesis) -> float:
        return min(side.acting(h) for side in sides)

    def admitted(h: Hypothesis) -> bool:
        return acts(h) > (LEAST_LATER if is_lateness(h.entry) else LEAST_ACTING)

    every = [
        h
        for h in hypotheses(model, scales)
        if admitted(h) and max(side.seen(h) for side in sides) > LEAST_SEEN
    ]
    singles = search.best_of_each(every, ())

    def apt(chosen: Chosen) -> bool:
        of_input = [h for h in chosen if of_actuator(h)]
        # Two are added here, and one acts on what the other leaves.
        if len(of_input) > 1 and min(map(acts, of_input)) <= LEAST_ACTING:
            return False
        effects = fitted_effects(search, chosen)
        return all(admissible(e, scales) for e in effects) and here.largest(
            chosen, search.fitted(0, chosen)
        ) < LARGEST * float(np.sqrt(np.mean(driven**2)))

    def named(chosen: Chosen) -> bool:
        pairs = own_columns(here.names, chosen)
        values = search.fitted(0, chosen)
        ends = any(h.ends_at_bound(values[own]) for h, own in pairs)
        return apt(chosen) and not ends and search.told_apart(chosen)

    # Two that hide each other: neither need be the best by itself, or be seen by itself at all.
    pairs = [pair for pair in itertools.combinations([h for (h,) in singles], 2) if different(*pair)]
    pairs = [_resized(search, every, pair) for pair in pairs]
    known = {frozenset(pair) for pair in pairs}
    leader = next(filter(apt, singles), singles[0] if singles else ())
    more = search.best_of_each(every, leader) if singles else []
    pairs += [pair for pair in more if frozenset(pair) not in known]
    levels: list[list[Chosen]] = [singles, pairs]
    if pairs:
        levels.append(_threes(search, every, pairs, apt))
    exact = ExactSizes(search, admitted)

    def sized(level: list[Chosen]) -> list[Chosen]:
        ranked = sorted(level, key=search.left_over)
        best = sorted(map(exact, ranked[:MOST_SIZED]), key=search.left_over)
        return _named_once([*best, *ranked[MOST_SIZED:]])

    levels = [*map(sized, levels)]
    folds = Search(model, Fold((here, there), False), Fold((here, there), True))
    return _weighed(search, folds, levels, cutoff, named)


def _resized(search: Search, every: Sequence[Hypothesis], pair: Chosen) -> Chosen:
    """Two effects, one of the actuator at the size of the grid that leaves least beside the other."""
    one, other = pair if of_actuator(pair[1]) else (pair[1], pair[0])
    if not of_actuator(other):
        return pair
    shapes = [h for h in every if (h.entry.name, h.location) == (other.entry.name, other.location)]
    return search.best_of_each(shapes, (one,))[0]


def _named_once(level: Sequence[Chosen]) -> list[Chosen]:
    """Groups, the best first, without those of whose names a better one has another size of an actuator's."""
    found, known = list[Chosen](), set[frozenset[tuple[str, str]]]()
    for chosen in level:
        names = frozenset((h.entry.name, h.location) for h in chosen)
        if names in known and any(map(of_actuator, chosen)):
            continue
        known.add(names)
        found.append(chosen)
    return found


def _threes(
    search: Search, every: Sequence[Hypothesis], pairs: Sequence[Chosen], apt: Callable[[Chosen], bool]
) -> list[Chosen]:
    """The pair that leaves least with every third, and the next ones with what is best as third there: of two
    forms of one thing the richer leaves less, and need not be the one that stands beside the third."""
    ranked = sorted(pairs, key=search.left_over)
    leader, *others = [*itertools.islice(filter(apt, ranked), MOST_EXTENDED)] or ranked[:MOST_EXTENDED]
    found = search.best_of_each(every, leader)
    best = [chosen[-1] for chosen in found[:MOST_EXTENDED]]
    # A size that is held is another one beside others.
    held = {(h.entry.name, h.location) for h in best if h.held}
    thirds = [h for h in every if h in best or (h.entry.name, h.location) in held]
    known = {frozenset(chosen) for chosen in found}
    for pair in others:
        for wider in search.best_of_each(thirds, pair):
            if frozenset(wider) not in known:
                known.add(frozenset(wider))
                found.append(wider)
    return found


def _weighed(
    search: Search,
    folds: Search,
    levels: Sequence[Sequence[Chosen]],
    cutoff: float,
    named: Callable[[Chosen], bool],
) -> SearchedGroups:
    """The best groups of each number of effects, of those that may be ``named``."""
    # What the fullest explanation leaves comes nearest to noise: how long that remembers says how many
    # samples count, and for all groups the same number.
    fullest = search.leader([(), *(chosen for level in levels for chosen in level)])
    search.count(fullest)
    half = 0.5 * sum(search.numbers)
    folds.numbers = (half, half)

    def gain(chosen: Chosen) -> float:
        return search.likelier(chosen) - A_PARAMETER * sum(h.parameters for h in chosen)

    kept = [
        [*itertools.islice(filter(named, sorted(level, key=gain, reverse=True)), BEAM)] for level in levels
    ]
    found = tuple(tuple(_group(search, chosen, gain(chosen)) for chosen in level) for level in kept if level)
    free_curves = folds.free_curves(())
    best = [level[0].hypotheses for level in found]
    most = max(folds.explained(terms) for terms in (free_curves, *best))
    return SearchedGroups(_group(search, (), 0.0), found, cutoff, most, free_curves, folds, search)


def fitted_effects(search: Search, chosen: Chosen) -> list[Effect]:
    """The effects of a group with their sizes, fitted to the first side's equations."""
    side, values = search.sides[0].side, search.fitted(0, chosen)
    arm = side.arm_scale(values)
    return [
        h.effect((arm if h.place == "arm" else 1.0) * values[own])
        for h, own in own_columns(side.names, chosen)
    ]


def _group(search: Search, chosen: Chosen, gain: float) -> Group:
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
