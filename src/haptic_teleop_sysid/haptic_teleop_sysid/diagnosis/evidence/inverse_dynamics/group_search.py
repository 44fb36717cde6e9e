"""What the inverse dynamics say: which effects, as torques along the motion, explain the input."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record

from ...hypotheses.admissible import admissible
from ...hypotheses.follows import is_lateness
from ...inputs.scales import Scales
from .band import motion_band
from .every_hypothesis import hypotheses
from .exact_sizes import ExactSizes
from .folds import Fold
from .groups import Chosen, Search, different
from .regression import equations, own_columns
from .searched_groups import SearchedGroups, fitted_effects, fitted_group
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
    found = tuple(
        tuple(fitted_group(search, chosen, gain(chosen)) for chosen in level) for level in kept if level
    )
    free_curves = folds.free_curves(())
    best = [level[0].hypotheses for level in found]
    most = max(folds.explained(terms) for terms in (free_curves, *best))
    return SearchedGroups(fitted_group(search, (), 0.0), found, cutoff, most, free_curves, folds, search)
