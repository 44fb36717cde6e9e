"""Which explanations remain possible beside the best one, and which form of one thing is told."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from haptic_teleop_sysid.estimation.fit import Fit

from ...evidence.by_blocks import chance
from ...hypotheses.explanation import Explanation
from ...policy import BY_CHANCE, CANNOT_TELL

#: Explanations whose score together is within this share of the best one's are as good: forms of friction
#: differ by more, while the noise of real recordings is not white to within a few percent.
AS_GOOD = 0.01


def margin(best: Explanation, other: Explanation) -> float:
    """Nats by which two explanations differ by chance: as their likelihoods scatter over the recordings."""
    scatter = chance(best.gains, other.gains)
    if scatter is None or max(best.by_current, other.by_current) > 0.0:
        # The noise of a current sense is white: what it says is taken at its word.
        scatter = BY_CHANCE + AS_GOOD * max(best.by_motion, 0.0)
    return max(BY_CHANCE, scatter)


def alike(other: Explanation, best: Explanation, apart: Callable[[Fit, Fit], float]) -> bool:
    """Whether an explanation that needs no more parameters is neither found nor expected to be told from the
    best one."""
    return (
        other is not best
        and len(other.effect.parameters) <= len(best.effect.parameters)
        and best.score - other.score < CANNOT_TELL
        and apart(best.fit, other.fit) < CANNOT_TELL
    )


def needlessly_rich(explanation: Explanation, others: Sequence[Explanation]) -> bool:
    """Whether it is a richer form of another explanation that scores no less: it contains that one, so it
    fits as well whatever is there, and the shape that it adds is where the recordings say nothing."""
    return any(_is_form(explanation, e) and e.score >= explanation.score for e in others)


def _is_form(rich: Explanation, plain: Explanation) -> bool:
    """Whether the first is a richer form of the second."""
    own = rich.effect.entry.refinement
    same = rich.effect.location == plain.effect.location
    return own is not None and same and own.of == plain.effect.effect
