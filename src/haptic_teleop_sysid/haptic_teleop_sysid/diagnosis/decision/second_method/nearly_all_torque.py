"""Names that explain nearly all the torque that is missing, whatever one-step predictions say.

No law is quite a machine's, and in a long recording the least difference is clear to a likelihood. Where the
inverse dynamics explain nearly all with few names, on stretches that were not fitted, and no free curve
explains most of the little that they leave, the names are the answer, and nobody is sure of them. Nor
does a shape of what they leave count where free runs with them hardly err, if no names leave none.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from ...evidence.inverse_dynamics.searched_groups import Group, SearchedGroups
from ...evidence.second_method import APART, NEGLIGIBLE, NO_WORSE, Errors, JudgedGroup, SecondMethod
from ...policy import LEAST_EXPLAINED, NEARLY_ALL, NEARLY_ALL_TORQUE, STRUCTURED
from ..adequacy import SLIGHT_ERROR


def nearly_all_torque(
    searched: SearchedGroups, errors: Errors, before: Sequence[tuple[float, float]]
) -> SecondMethod | None:
    """The answer that chooses, of the groups that gain most for their number of effects, the one with
    the fewest of which holds: together they explain NEARLY_ALL_TORQUE of what any torque does, and NEARLY_ALL
    of what is missing, each of them LEAST_EXPLAINED of what the others leave; beside them no free curve
    explains STRUCTURED of the rest, or, where that holds of no group, they explain NEARLY_ALL_TORQUE of
    all that is missing, and their free runs (``errors``) err by no more than SLIGHT_ERROR; and these err no
    more than any of those ``before`` on either kind of recordings, and less than the mean. None where there
    is none. Its rivals are the groups of as many effects of which all that holds, too."""
    least = [min(kind) for kind in zip(*before, strict=True)]

    def stands(group: Group, slight: bool) -> JudgedGroup | None:
        most = NEARLY_ALL_TORQUE * (1.0 if slight else searched.recoverable)
        if group.gain <= 0.0 or not _explain(searched, group, most):
            return None
        if not slight and _has_shape(searched, group):
            return None
        found = errors(group.model)
        if any(e > NO_WORSE * b or e >= 1.0 for e, b in zip(found, least, strict=True)):
            return None
        return None if slight and max(found) > SLIGHT_ERROR else JudgedGroup(group, group.gain, found)

    for slight, level in itertools.product((False, True), searched.levels):
        best, *others = sorted(level, key=lambda group: -group.gain)
        chosen = stands(best, slight)
        if chosen is None:
            continue
        near = [g for g in others if g.gain > best.gain - NEGLIGIBLE * APART]
        judged = [chosen, *(h for g in near if (h := stands(g, slight)) is not None)]
        weights = [math.exp((h.gain - best.gain) / APART) for h in judged]
        shares = (w / sum(weights) for w in weights)
        return SecondMethod(chosen, tuple(zip(judged, shares, strict=True)), searched)
    return None


def _explain(searched: SearchedGroups, group: Group, most: float) -> bool:
    """Whether a group explains ``most`` of what is missing, and NEARLY_ALL, and each of its effects is
    needed."""
    left = 1.0 - searched.folds.explained(group.hypotheses)
    if left > 1.0 - max(most, NEARLY_ALL):
        return False
    all_but_one = itertools.combinations(group.hypotheses, len(group.hypotheses) - 1)
    without = (1.0 - searched.folds.explained(others) for others in all_but_one)
    return all(left <= (1.0 - LEAST_EXPLAINED) * more for more in without)


def _has_shape(searched: SearchedGroups, group: Group) -> bool:
    """Whether a free curve explains most of what a group leaves."""
    rest = searched.beside(group)
    return rest is not None and rest[1] >= STRUCTURED
