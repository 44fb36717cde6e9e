"""The second method: groups of torques that the inverse dynamics name, judged by free runs, too.

The first method judges by one-step prediction and by a model of the noise.  A real machine's innovations are
never white, and then that model buys colour with wrong inertias: what matters over a tenth of a second or a
second hardly counts.  Band-limited inverse dynamics (`inverse_dynamics`) do not ask for the noise, and a free
run does not correct.  What gains by both is believed over a name whose innovations show that its noise model
does not hold.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Model

from ..hypotheses.admissible import admissible
from ..inputs.scales import Scales
from ..policy import AN_EFFECT, ERRS_LESS, LEAST_GAIN, NEARLY_ALL
from .horizons import PERFECT
from .inverse_dynamics.searched_groups import Group, SearchedGroups

#: Log-likelihood that counts for each time that the error of the free run falls by a factor e on one kind of
#: recordings: halved on both it counts as much as two effects must gain.
FREE_RUN = 10.0
#: Factor by which the error of the free run may rise on one kind of recordings.
NO_WORSE = 1.02
#: Difference in what groups gain, by both, at which the weight of the lesser falls to a third.
APART = 3.0
#: Differences of APART at which a rival has no weight.
NEGLIGIBLE = 4.0
#: Groups of each number of effects that are run, whatever they gain.
ALWAYS = 3
#: Log-likelihood by which a free run may exceed the best of those that were run.
UNSEEN = 5.0
#: Error of the free runs of a model on estimation and on validation recordings, as a share of the motion's
#: spread: 1 is no better than the mean (see `horizons`).
Errors = Callable[[Model], tuple[float, float]]
#: Effects with their locations.
Names = set[tuple[str, str]]


@dataclass(frozen=True)
class JudgedGroup:
    """A group with what it gains in all: by the inverse dynamics and by free runs; ``errors``: of those."""

    group: Group
    gain: float
    errors: tuple[float, float]


@dataclass(frozen=True)
class SecondMethod:
    """``chosen``: the group that is believed, None where none is; ``rivals``: all of as many effects with
    their weights, the chosen one first; ``searched``: what it comes from."""

    chosen: JudgedGroup | None
    rivals: tuple[tuple[JudgedGroup, float], ...]
    searched: SearchedGroups

    @property
    def explains_most(self) -> bool:
        """Whether the chosen effects explain nearly all that free curves could."""
        if self.chosen is None:
            return False
        return self.chosen.group.explained > NEARLY_ALL * self.searched.recoverable

    @cached_property
    def adequacy(self) -> float:
        """The least of the chosen effects' (see `Search.adequacies`); 0 where nothing is believed."""
        if self.chosen is None:
            return 0.0
        return min(self.searched.folds.adequacies(self.chosen.group.hypotheses))


def judge_groups(
    searched: SearchedGroups, scales: Scales, errors: Errors, before: tuple[float, float]
) -> SecondMethod:
    """What the second method says of groups of effects; ``before``: errors of free runs of the best that the
    structure alone does, however fitted."""
    floor = [max(e, PERFECT) for e in before]

    def judge(group: Group) -> JudgedGroup | None:
        if not all(admissible(e, scales) for e in group.effects):
            return None
        group = fitted_to_both(searched, group, errors)
        found = errors(group.model)
        # A free run that is no better than the mean says nothing for it, however bad the structure's is.
        if any(e > NO_WORSE * b or e >= 1.0 for e, b in zip(found, floor, strict=True)):
            return None
        ratios = [math.log(b / max(e, PERFECT)) for e, b in zip(found, floor, strict=True)]
        return JudgedGroup(group, group.gain + FREE_RUN * sum(ratios), found)

    chosen: JudgedGroup | None = None
    rivals: list[JudgedGroup] = []
    fewer = freely = 0.0  # the most that fewer effects gain, and that free runs have counted so far
    for level in searched.levels:
        more = len(level[0].effects) - (len(chosen.group.effects) if chosen else 0)
        enough = (chosen.gain if chosen else 0.0) + AN_EFFECT * more
        ranked: list[JudgedGroup] = []
        for number, group in enumerate(level):
            if group.gain <= fewer:
                break  # what explains no more torque than fewer effects do, or none, does not gain by both
            needed = max([enough, *(h.gain - NEGLIGIBLE * APART for h in ranked)])
            if number >= ALWAYS and group.gain + freely + UNSEEN < needed:
                break  # whatever its free run says; and so with those that gain less
            one = judge(group)
            if one is not None:
                ranked.append(one)
                freely = max(freely, one.gain - group.gain)
        fewer = max(fewer, level[0].gain)
        ranked.sort(key=lambda h: -h.gain)
        if ranked and ranked[0].gain > enough:
            rivals = plainer_first(ranked)
            chosen = rivals[0]
    weights = np.array([math.exp((h.gain - rivals[0].gain) / APART) for h in rivals])
    shares = weights / weights.sum() if len(weights) else weights
    return SecondMethod(chosen, tuple(zip(rivals, shares.tolist(), strict=True)), searched)


def fitted_to_both(searched: SearchedGroups, group: Group, errors: Errors) -> Group:
    """The group, or as both kinds of recordings settle it (`SearchedGroups.settling`), where free runs of
    that err less in the mean of both."""
    other = searched.settling(group)
    if other is None or not math.prod(errors(other.model)) < math.prod(errors(group.model)):
        return group
    return other


def plainer_first(ranked: Sequence[JudgedGroup]) -> list[JudgedGroup]:
    """Groups of as many effects, best first. One that differs from the first one in a plainer form of one
    effect changes its gain, and its place, with it, unless the shape of the richer form gains LEAST_GAIN from
    the torques, or makes free runs err less by ERRS_LESS: then it is more than what is left of something
    else."""
    first, *others = ranked
    for number, other in enumerate(others, start=1):
        if not plainer(named_by(other.group), named_by(first.group)):
            continue
        pairs = zip(first.errors, other.errors, strict=True)
        less = math.prod(max(a, PERFECT) / max(b, PERFECT) for a, b in pairs)
        if first.group.gain - other.group.gain < LEAST_GAIN and less > ERRS_LESS**2:
            found = [replace(other, gain=first.gain), *others]
            found[number] = replace(first, gain=other.gain)
            return plainer_first(found)
    return [*ranked]


def named_by(group: Group) -> Names:
    """A group's effects and their locations."""
    return {(h.entry.name, h.location) for h in group.hypotheses}


def plainer(names: Names, richer: Names) -> bool:
    """Whether effects, with their locations, are those of ``richer``, one of them in its plainer form."""
    own, theirs = names - richer, richer - names
    if len(own) != 1 or len(theirs) != 1:
        return False
    (name, location), (rich, place) = own.pop(), theirs.pop()
    refinement = EFFECTS[rich].refinement
    return place == location and refinement is not None and refinement.of == name
