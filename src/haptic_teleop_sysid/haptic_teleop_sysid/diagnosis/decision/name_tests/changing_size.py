"""A name whose size changes with something that is not in it stands for another effect."""

from __future__ import annotations

from collections.abc import Sequence

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ...evidence.certainty import known_beside
from ...evidence.held_out import held_out_fit
from ...evidence.modulation import changes_with, modulations
from ...evidence.null_records import null_records
from ...hypotheses.follows import follows_from_input
from ..coloured import BY_ROUNDING
from ..search.rounds import SearchResult
from .beside_the_others import left_out, without

#: Relative change of a size, per standard deviation of what it changes with, and nats, from which on both
#: kinds of recordings the effect is something else: of 173 torques, and of 79 names of any kind on another
#: seed of the benchmark, all right, none changed by more than 10 % (hystereses of another form). What follows
#: another axis, named friction, changes by 53 %, the lag of a coupling that slips by 23 to 37 %.
CHANGES, CHANGES_GAIN = 0.2, 20.0


def one_size_each(
    result: SearchResult, estimation: Sequence[Record], validation: Sequence[Record]
) -> SearchResult:
    """The result without those of several names that say what an actuator makes of its command and whose size
    changes; the one that changes most goes first, and the others are asked again. The last name has been
    asked, whatever it is (see `Objections`), unless the others that came after it have gone since. Friction
    beside other names is not asked: on real machines it varies, and in a closed loop the input answers to
    that."""
    while len(result.choices) > 1:
        fit = result.final
        there = held_out_fit(fit, validation, [fit.noise])
        found = []
        for choice in result.choices:
            effect = choice.chosen.effect
            if choice.chosen.by_current > 0.0 or not follows_from_input(effect.entry):
                continue
            again = fitted_there(fit, there, effect, validation)
            changing = changing_with(fit, again, effect, estimation, validation)
            if changing is not None:
                found.append((abs(changing[1]), choice, in_words(effect, *changing)))
        if not found:
            break
        _, choice, why = max(found, key=lambda one: one[0])
        result = left_out(result, choice, why, without(result, choice.chosen.effect, estimation))
    return result


def fitted_there(fit: Fit, there: Fit, effect: Effect, validation: Sequence[Record]) -> Fit:
    """The fit to the validation recordings, where an effect of ``fit`` is free, and all else stays as well
    known as it was: these recordings may not determine all of the structure. ``there``: the same model with
    their noise levels."""
    head = f"{effect.location}.{effect.effect}."
    known = known_beside(fit, tuple(name for name in fit.free if name.startswith(head)))
    return fit_whole(fit.model, there.noise, validation, free=fit.free, known=known)


def changing_with(
    fit: Fit, again: Fit, effect: Effect, estimation: Sequence[Record], validation: Sequence[Record]
) -> tuple[str, float] | None:
    """What the size of an effect changes with, and by how much; None where it keeps it. ``again``: the fit to
    the validation recordings.

    A coarse encoder tells late that a joint has turned or begins to move: what the size changes by on
    simulated recordings of the same fit, where it is constant, is the encoder's."""
    found = changes_with(
        modulations(fit, effect, estimation), modulations(again, effect, validation), CHANGES, CHANGES_GAIN
    )
    if not found:
        return None
    made = modulations(fit, effect, null_records(fit, estimation))
    for what, share in found:
        by_rounding = made[what].share if what in made else 0.0
        if abs(share) > BY_ROUNDING * abs(by_rounding):
            return what, share
    return None


def in_words(effect: Effect, what: str, share: float) -> str:
    return (
        f"the size of {effect.effect} would change with the {what}, by {100 * abs(share):.0f} % of its mean "
        "per standard deviation of that"
    )
