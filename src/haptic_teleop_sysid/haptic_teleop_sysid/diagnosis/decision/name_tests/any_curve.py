"""Names that bend to any curve over their quantity are not the answer.

An inertia that varies with the angle, fitted to a spring that is not straight, comes nearer to it than other
names do, and leaves a torque that follows the angle.  A ripple of which hardly one cycle shows and a spring
beside it are two terms of a series: together they come near to any torque over the angle.
"""

from __future__ import annotations

from collections.abc import Sequence

from haptic_teleop_sysid.estimation.records import Record

from ...evidence.residual import conditions
from ..reasons import Doubt
from ..search.decide import Choice
from ..search.rounds import SearchResult
from ..where import condition_of, structured


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


def one_curve(result: SearchResult) -> tuple[SearchResult, Doubt | None]:
    """The result without its names, and the doubt that says why, where one of them is a torque over the angle
    that its entry calls doubtful on such recordings, and another one a torque over the same angle."""
    curves = [c for c in result.choices if _over_the_angle(c)]
    for choice in curves:
        effect = choice.chosen.effect
        doubtful = effect.entry.doubtful
        beside = [c for c in curves if c is not choice and c.chosen.effect.location == effect.location]
        if beside and doubtful and doubtful(effect.values, result.scales.at(effect.location)):
            names = " and ".join(c.chosen.effect.effect for c in (choice, *beside))
            why = (
                f"{names} at {effect.location} are two torques over one angle, of which the first is not "
                "seen over more than one and a half cycles: together they come near to any curve over it"
            )
            others = [c for c in result.choices if c is not choice and c not in beside]
            result = result.giving_up(others, f"it was found beside {names}, which may be any curve")
            return result.without_names([choice, *beside], why), Doubt(choice, why, short=True)
    return result, None


def _over_the_angle(choice: Choice) -> bool:
    entry = choice.chosen.effect.entry
    return entry.kind == "torque" and entry.follows == "angle" and not entry.momentary
