"""A name whose own quantity still explains most of what it leaves is not the answer.

An inertia that varies with the angle, fitted to a spring that is not straight, comes nearer to it than other
names do, and leaves a torque that follows the angle.
"""

from __future__ import annotations

from collections.abc import Sequence

from haptic_teleop_sysid.estimation.records import Record

from ..evidence.residual import conditions
from .reasons import Doubt
from .search import SearchResult
from .verdict import condition_of, structured


def follows_still(
    result: SearchResult, estimation: Sequence[Record], validation: Sequence[Record]
) -> tuple[SearchResult, Doubt | None]:
    """The result without its names, and the doubt that says why, where one of those whose entry says that it
    bends to much (`EffectEntry.versatile`) leaves a noticeable torque at its place that follows its own
    quantity."""
    suspects = [c for c in result.choices if c.chosen.effect.entry.versatile]
    if not suspects:
        return result, None
    model = result.final.model
    left = conditions(result.final, estimation, validation, model.joint)
    still = structured(result.final, left, estimation, result)
    for choice in suspects:
        effect = choice.chosen.effect
        own = condition_of(model, effect.effect, effect.location, left)
        if still is not None and still.equation == effect.location and still.name in own:
            why = (
                f"the most similar effect, {effect.effect} at {effect.location}, leaves a torque of which "
                f"the {still.name} explains {100 * still.explained:.0f} % on recordings that were not fitted"
            )
            return result.without_names([choice], why), Doubt(choice, why)
    return result, None
