"""Names that explain nearly all the torque that is missing, whatever one-step predictions say.

No law is quite a machine's, and in a long recording the least difference is clear to a likelihood. Where the
inverse dynamics explain nearly all with few names, on stretches that were not fitted, and no torque without a
form explains most of the little that they leave, the names are the answer, and the rest is told beside them.
"""

from __future__ import annotations

import math

from ..evidence.inverse_dynamics.groups import Chosen
from ..evidence.inverse_dynamics.witness import Group, Witness
from ..evidence.second_opinion import APART, NEGLIGIBLE, NO_WORSE, Errors, Heard, Opinion
from ..policy import LEAST_EXPLAINED, NEARLY_WHOLE, STRUCTURED


def nearly_whole(witness: Witness, errors: Errors, before: tuple[float, float]) -> Opinion | None:
    """The opinion that chooses the fewest effects that explain NEARLY_WHOLE of what is missing, each of them
    LEAST_EXPLAINED of what the others leave, and beside which no torque without a form explains STRUCTURED of
    the rest; its rivals are as many effects that gain as much. ``errors``: of free runs, which are no worse
    than ``before``, and better than the mean. None where there are none."""

    def whole(group: Group) -> bool:
        if group.gain <= 0.0 or group.explained < NEARLY_WHOLE:
            return False
        without = map(witness.folds.explained, _all_but_one(group.hypotheses))
        if any(1.0 - group.explained > LEAST_EXPLAINED * (1.0 - share) for share in without):
            return False
        rest = witness.beside(group)
        return rest is None or rest[1] < STRUCTURED

    for level in witness.levels:
        best = max(level, key=lambda group: group.gain)
        if not whole(best):
            continue
        found = errors(best.model)
        if any(e > NO_WORSE * b or e >= 1.0 for e, b in zip(found, before, strict=True)):
            continue
        return Opinion(Heard(best, best.gain, found), _rivals(best, level, errors), witness)
    return None


def _all_but_one(named: Chosen) -> list[Chosen]:
    """A group's effects without each of them, none where it has only one."""
    if len(named) == 1:
        return []
    return [named[:i] + named[i + 1 :] for i in range(len(named))]


def _rivals(
    best: Group, level: tuple[Group, ...], errors: Errors
) -> tuple[tuple[Heard, float], ...]:
    """The groups of a level with their weights by what they gain, the best first."""
    near = [g for g in level if g.gain > best.gain - NEGLIGIBLE * APART]
    weights = [math.exp((g.gain - best.gain) / APART) for g in near]
    ranked = sorted(zip(near, weights, strict=True), key=lambda one: -one[1])
    return tuple((Heard(g, g.gain, errors(g.model)), w / sum(weights)) for g, w in ranked)
