"""Two names in place of a law that has none: two effects at one place look like one of another form."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from haptic_teleop_sysid.estimation.fit import Fit

from ...hypotheses.explanation import Explanation
from ...policy import CLEARLY_LESS
from .decide import SHARE_LESS, Choice


def two_names(
    nameless: Choice,
    found: Sequence[Explanation],
    beside: Callable[[Fit], list[Explanation]],
    pick: Callable[..., Choice | None],
) -> list[Choice]:
    """The best name and the next one beside it, where together they score better than a law without a name,
    by as much as that has to be better than one of them; empty where they do not. A quadratic drag with dry
    friction passes for a drag that grows faster than the square.

    ``found``: what the law was chosen from; ``beside``: what explains the recordings beside a fit; ``pick``:
    see `choose`.
    """
    first = pick([e for e in found if not e.effect.entry.unnamed], 0.0)
    if first is None or first.chosen.by_current > 0.0:
        return []
    second = pick(beside(first.chosen.fit), first.chosen.score, further=True)
    if second is None or second.unnamed:
        return []
    both, alone = first.chosen.score + second.chosen.score, nameless.chosen.score
    return [first, second] if both > alone + max(CLEARLY_LESS, SHARE_LESS * alone) else []
