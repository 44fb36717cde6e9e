"""How a result stands on both kinds of recordings: what is left coloured, and what sizes differ by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..evidence.certainty import known_beside, standard_errors
from ..evidence.held_out import held_out_fit
from ..evidence.whiteness import colour
from ..policy import SIGNIFICANT
from .search.decide import Choice
from .search.rounds import SearchResult

#: Standard errors, spread between recordings included, that a size must differ by from none.
STANDS_OUT = 2.0


@dataclass(frozen=True)
class Stand:
    """How a result stands on both kinds of recordings.

    ``before``, ``after``: `colour` on estimation and validation recordings, of baseline and final model;
    ``spread``: what a parameter differs by between the recordings beyond its standard errors, as a standard
    deviation: the form of an effect is never quite right, and that shows in other recordings.
    """

    before: tuple[float, float]
    after: tuple[float, float]
    spread: dict[str, float]


def stand_of(
    result: SearchResult,
    before: tuple[float, float],
    estimation: Sequence[Record],
    validation: Sequence[Record],
) -> Stand:
    fit = result.final
    there = held_out_fit(fit, validation, [fit.noise])
    after = colours(fit, estimation, validation, there)
    own = tuple(name for name in fit.free if "." in name)
    if not own:
        return Stand(before, after, {})
    return Stand(before, after, _spread(fit, there, validation, own))


def colours(
    fit: Fit, estimation: Sequence[Record], validation: Sequence[Record], there: Fit | None = None
) -> tuple[float, float]:
    """Colour of a fit's innovations on either kind of recordings; ``there``: the fit with the noise levels of
    the validation recordings, computed where it is not given."""
    there = held_out_fit(fit, validation, [fit.noise]) if there is None else there
    return colour(fit, estimation), colour(there, validation)


def _spread(
    fit: Fit, there: Fit, validation: Sequence[Record], names: tuple[str, ...], held: Sequence[str] = ()
) -> dict[str, float]:
    """By what the named parameters differ on the validation recordings beyond their standard errors, fitted
    there anew (``there``: with those recordings' noise levels), the structure as well known as it was and
    ``held`` kept."""
    free = tuple(n for n in fit.free if n not in held)
    places = [fit.free.index(n) for n in free]
    given = replace(fit, free=free, information=fit.information[np.ix_(places, places)])
    known = known_beside(given, names)
    again = fit_whole(fit.model, there.noise, validation, free=free, known=known)
    here, elsewhere = fit.model.parameter_values(), again.model.parameter_values()
    std, std_there = standard_errors(fit, held), standard_errors(again)
    neutral = {
        f"{e.location}.{e.effect}.{p.name}": p.neutral
        for e in fit.model.effects
        for p in e.entry.parameters
        if p.neutral is not None and np.isfinite(p.neutral)
    }
    spread = {}
    for name in names:
        chance = std.get(name, 0.0) ** 2 + std_there.get(name, 0.0) ** 2
        apart = (here[name] - elsewhere[name]) ** 2
        # Recordings that hardly determine a size, or could not tell one like this from none, say nothing of
        # its spread; that they want another one for certain is an objection of its own.
        too_small = name in neutral and abs(here[name] - neutral[name]) < std_there.get(name, 0.0)
        varies = apart > SIGNIFICANT**2 * chance and not too_small
        spread[name] = float(np.sqrt((apart - chance) / 2.0)) if varies else 0.0
    return spread


def stands_out(choice: Choice, final: Fit, stand: Stand, validation: Sequence[Record]) -> bool:
    """Whether one of the effect's sizes differs from none by more than its uncertainty, spread included: with
    all its parameters in doubt, or its sizes alone (a slow drift has a rate, but no time constant). A limit,
    which is none where it is infinite, has the relative error of its inverse."""
    effect = choice.chosen.effect
    head = f"{effect.location}.{effect.effect}."
    sizes = {
        head + p.name: p.neutral if np.isfinite(p.neutral) else 0.0
        for p in effect.entry.parameters
        if p.default is None and p.neutral is not None and head + p.name in stand.spread
    }
    values = final.model.parameter_values()
    std = standard_errors(final)

    def out(std: dict[str, float], spread: dict[str, float]) -> bool:
        return any(
            abs(values[n] - none) > STANDS_OUT * np.hypot(std.get(n, 0.0), spread[n])
            for n, none in sizes.items()
        )

    if not sizes or out(std, stand.spread):
        return True
    shape = [n for n in final.free if n.startswith(head) and n not in sizes]
    if not shape:
        return False
    there = held_out_fit(final, validation, [final.noise])
    return out(standard_errors(final, shape), _spread(final, there, validation, tuple(sizes), shape))
