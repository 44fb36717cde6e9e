"""Richer forms of a friction or a limit that was found, fitted from the size that the plain form came to, and
a contact that hardly slides, from where a spring came to.

A linearisation tells forms of friction apart where they are small.  From there a strong Stribeck friction was
fitted 600 nats below what it explains, with a breakaway below what slides, so that it passed for a plain one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.effects import EFFECTS, EffectEntry
from haptic_teleop_sim.effects.hypothesis import Refinement
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..hypotheses.candidates import family
from ..inputs.scales import Scales
from .answers import Answers
from .scan import scanned_values

#: Gain (nats) of an effect from which its forms are tried, and by which a form must exceed the plain one
#: after a few steps to be fitted to the end.
_STRONG, _BETTER = 12.0, 3.0
_STEPS = 8
#: Orders of the angle that friction may vary with, from this many nats that they promise.
_ORDERS, _PROMISES = 2, 12.0


def richer_forms(
    fits: Sequence[Fit], before: Fit, index: int, records: Sequence[Record], scales: Scales, limits: Limits
) -> list[Fit]:
    """Fits of the richer forms of the plain effect among ``fits`` (one a place) that promise more than it,
    one of each form; ``before``: the model without it, ``index``: its place among the effects."""
    found = []
    for fit in fits:
        effect = fit.model.effects[index]
        others = (*fit.model.effects[:index], *fit.model.effects[index + 1 :])
        there = {e.effect for e in others if e.location == effect.location}
        richer = [e for e in refinements(effect) if not family(e.name) & there]
        if not richer or fit.log_likelihood < before.log_likelihood + _STRONG:
            continue
        plain = fit_whole(fit.model, fit.noise, records, free=fit.free, iterations=_STEPS, limits=limits)
        if not _size(effect) > 0.0:
            continue
        forms = [f for entry in richer for f in _forms(entry, effect, plain, index, records, scales)]

        def fitted(form: Effect, fit: Fit = fit, plain: Fit = plain) -> Fit:
            wider = instead(fit.model, index, form)
            return fit_whole(wider, plain.noise, records, iterations=_STEPS, limits=limits)

        best: dict[str, Fit] = {}
        for form, one in zip(forms, side_by_side(fitted, forms), strict=True):
            known = best.get(form.effect)
            if np.isfinite(one.log_likelihood) and (
                known is None or one.log_likelihood > known.log_likelihood
            ):
                best[form.effect] = one
        found += [f for f in best.values() if f.log_likelihood > plain.log_likelihood + _BETTER]
    return found


def refinements(effect: Effect) -> list[EffectEntry]:
    """The entries that are richer forms of the effect, or that begin where it came to."""
    return [e for e in EFFECTS.values() if _begins(e, effect) is not None]


def _begins(entry: EffectEntry, effect: Effect) -> Refinement | None:
    known = (entry.refinement, entry.begun_from)
    return next((r for r in known if r is not None and r.of == effect.effect), None)


def _size(effect: Effect) -> float:
    """The size of an effect, its first parameter."""
    return effect.parameters[effect.entry.parameters[0].name]


def _forms(
    entry: EffectEntry,
    effect: Effect,
    plain: Fit,
    index: int,
    records: Sequence[Record],
    scales: Scales,
) -> Iterator[Effect]:
    """One richer form of about the size of a plain ``effect``; where something of it is scanned, of that of
    its fit ``plain``, at the values that promise most beside it."""
    begins = _begins(entry, effect)
    assert begins is not None
    on, location = scales.at(effect.location), effect.location
    parameter = next((p for p in entry.parameters if p.scan), None)
    if parameter is None:
        for parameters in begins.starts(effect.parameters, on, math.nan):
            yield Effect(entry.name, location, parameters)
        return
    effect = plain.model.effects[index]
    if not _size(effect) > 0.0:
        return
    place = location.rpartition("_")[2]
    values = list(scanned_values(parameter, scales, place))
    if not values:
        return
    try:
        gains = Answers(plain, records).gains(entry, parameter, place, values)
    except FAILURES:
        return
    for i in np.argsort(-gains)[:_ORDERS]:
        if gains[i] > _PROMISES:
            for parameters in begins.starts(effect.parameters, on, values[i]):
                yield Effect(entry.name, location, parameters)


def instead(model: Model, index: int, effect: Effect) -> Model:
    """The model with another effect in that place."""
    old = model.effects[index]
    head = f"{old.location}.{old.effect}."
    fixed = tuple(name for name in model.fixed if not name.startswith(head))
    effects = (*model.effects[:index], effect, *model.effects[index + 1 :])
    return replace(model, effects=effects, fixed=fixed)
