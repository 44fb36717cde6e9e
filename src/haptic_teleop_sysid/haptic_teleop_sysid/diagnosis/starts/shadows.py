"""The other things that load the joint: what holds the arm is answered by the motor, and the other way round.

A torque that hardly changes looks the same at the motor and, with a preload of the joint, at the arm; gravity
high up and a far spring are constant torques.  A linearisation without the preload promises none of them
much, so each is tried from where another one ended.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.effects import locations
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits

from ..hypotheses.candidates import companion, family
from .trials import best_of_each, polish, with_companion

#: Nats behind the best one from which a thing that explains the same has not ended where it could.
_SHORT_OF = 2.0
#: Times that one may get farther as a shadow and cast its own anew.
_OFTEN = 2
#: Nats behind the best fit of all up to which one that loads the joint may be what is there.
_AMONG_THE_BEST = 10.0


def shadows(effect: Effect) -> list[Effect]:
    """What loads the joint as ``effect`` does; [] for one that does not."""
    head, _, part = effect.location.rpartition("_")
    found = []
    for other in effect.entry.equivalents:
        if other.condition and part in other.at:
            place = ("arm" if part == "motor" else "motor") if other.across else part
            numbers = effect.parameters if other.numbers is None else other.numbers(effect.parameters)
            if numbers:
                found.append(Effect(other.effect, f"{head}_{place}", numbers))
    return found


def _at_rest(effect: Effect) -> float:
    """Torque of the effect at angle zero, N·m, by its entry."""
    at_rest = effect.entry.at_rest
    return 0.0 if at_rest is None else at_rest(effect.values)


def with_shadows(fits: Sequence[Fit], before: Fit, records: Sequence[Record], limits: Limits) -> list[Fit]:
    """The fits (best first), and the shadows of those that load the joint and are among the best, where they
    are missing or stopped short of them; ``before``: without any of these effects."""
    if not fits:
        return []
    index = len(before.model.effects)
    near = [f for f in fits if f.log_likelihood > fits[0].log_likelihood - _AMONG_THE_BEST]
    found, again = list(fits), Counter()
    present = {(n, e.location) for e in before.model.effects for n in family(e.effect)}
    for one in near:  # which grows: a shadow, or one that got farther, has shadows of its own
        for other in shadows(one.model.effects[index]):
            places = locations(other.effect, before.model.structure)
            if before.model.place(other.location) not in places or (other.effect, other.location) in present:
                continue
            best = best_of_each(found, index)
            ends = {(f.model.effects[index].effect, f.model.effects[index].location): f for f in best}
            end = ends.get((other.effect, other.location))
            if end is None or end.log_likelihood < one.log_likelihood - _SHORT_OF:
                cast = _from_there(one, other, before, records, limits)
                found.append(cast)
                farther = end is None or cast.log_likelihood > end.log_likelihood + _SHORT_OF
                again[other.effect, other.location] += 1
                farther = farther and again[other.effect, other.location] <= _OFTEN
                if farther and cast.log_likelihood > fits[0].log_likelihood - _AMONG_THE_BEST:
                    near.append(cast)
    return best_of_each(found, index)


def _from_there(one: Fit, other: Effect, before: Fit, records: Sequence[Record], limits: Limits) -> Fit:
    """The fit of a shadow from where another one ended."""
    effects = [*one.model.effects[: len(before.model.effects)], other]
    if preload := companion(before.model, other) if other.location.endswith("_arm") else None:
        # Zeroed under load: what the joint carries at rest.
        effects.append(replace(preload, parameters={n: -_at_rest(other) for n in preload.parameters}))
    start = replace(one, model=replace(one.model, effects=tuple(effects), fixed=before.model.fixed))
    start = replace(start, free=start.model.free_parameters())
    return with_companion(polish(start, records, limits), before.model, records, limits)
