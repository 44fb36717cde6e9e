"""How a result stands on both kinds of recordings: what is left coloured, and what sizes differ by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import channels, innovations, settled
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from .decide import Choice, standard_errors
from .held_out import held_out_fit
from .search import SearchResult

#: Lags of the portmanteau test; of white innovations it is 25 on average, and 53 once in a thousand.
LAGS = 25
#: Samples over which the power of the innovations is averaged to see whether it changes with time.
STRETCH = 125
#: Power of innovations, in squares of the encoder's step, up to which one stretch is as steady as another:
#: where an axis hardly moves, errors of rounding (1/12) follow each other and their power changes by itself.
ROUNDING = 1.2 / 12.0
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


def colour(fit: Fit, records: Sequence[Record]) -> float:
    """Largest portmanteau statistic of the motor's innovations over the recordings: n times the sum of
    squared autocorrelations at the first LAGS lags, LAGS on average for white ones."""
    found = []
    for record in records:
        e = settled(record, innovations(pack(fit.model), fit.noise, record).innovation)[:, 0]
        e = e[np.isfinite(e)] - np.mean(e[np.isfinite(e)])
        power = float(e @ e)
        if power <= 0.0 or len(e) <= 2 * LAGS:
            continue
        found.append(len(e) * sum((float(e[k:] @ e[:-k]) / power) ** 2 for k in range(1, LAGS + 1)))
    return max(found, default=0.0)


def unsteadiness(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> float:
    """How far the power of the innovations changes with time, on every recording of all (fit, recordings):
    the spread of its means over STRETCH samples, relative to what it is when samples are independent (then
    1), whatever their distribution.  Of two encoders the one that is less steady counts, and 0 where
    there is none."""
    least = np.full(2, np.inf)
    for fit, records in fits:
        packed = pack(fit.model)
        for record in records:
            seen = channels(packed, record)
            least[[c for c in (0, 1) if c not in seen]] = 0.0
            power = settled(record, innovations(packed, fit.noise, record).innovation) ** 2
            parts = np.array([x.mean(axis=0) for x in np.array_split(power, max(1, len(power) // STRETCH))])
            parts = np.maximum(parts, ROUNDING * np.square(record.resolution))
            alone = power.std(axis=0) / np.sqrt(STRETCH)
            ratio = np.divide(parts.std(axis=0), alone, out=np.zeros(2), where=alone > 0.0)
            least = np.minimum(least, ratio)
    return float(np.max(least, initial=0.0, where=np.isfinite(least)))


def stand_of(
    result: SearchResult,
    before: tuple[float, float],
    estimation: Sequence[Record],
    validation: Sequence[Record],
) -> Stand:
    fit = result.final
    there = held_out_fit(fit, validation, [fit.noise])
    after = colour(fit, estimation), colour(there, validation)
    own = tuple(name for name in fit.free if "." in name)
    if not own:
        return Stand(before, after, {})
    return Stand(before, after, _spread(fit, there, validation, own))


def _spread(
    fit: Fit, there: Fit, validation: Sequence[Record], names: tuple[str, ...], held: Sequence[str] = ()
) -> dict[str, float]:
    """By what parameters differ on the validation recordings beyond their standard errors, fitted there
    alone (``there``: with those recordings' noise levels), ``held`` being known."""
    again = fit_whole(fit.model, there.noise, validation, free=names)
    here, elsewhere = fit.model.parameter_values(), again.model.parameter_values()
    std, std_there = standard_errors(fit, held), standard_errors(again)
    spread = {}
    for name in names:
        chance = std.get(name, 0.0) ** 2 + std_there.get(name, 0.0) ** 2
        spread[name] = float(np.sqrt(max((here[name] - elsewhere[name]) ** 2 - chance, 0.0) / 2.0))
    return spread


def stands_out(choice: Choice, final: Fit, stand: Stand, validation: Sequence[Record]) -> bool:
    """Whether one of the effect's sizes differs from none by more than its uncertainty, spread included: with
    all its parameters in doubt, or its sizes alone (a slow drift has a rate, but no time constant)."""
    effect = choice.chosen.effect
    head = f"{effect.location}.{effect.effect}."
    sizes = {
        head + p.name: p.neutral
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
