"""Richer forms of a friction that was found, fitted from the size that the plain form came to.

A linearisation tells forms of friction apart where they are small.  From there a strong Stribeck friction was
fitted 600 nats below what it explains, with a breakaway below what slides, so that it passed for a plain one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit, Limits
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from .answers import Answers
from .scales import Scales
from .scan import scanned_values

#: Gain (nats) of a friction from which its forms are tried, and by which a form must exceed the plain one
#: after a few steps to be fitted to the end.
_STRONG, _BETTER = 12.0, 3.0
_STEPS = 8
#: Shares of the rms velocity over which friction may fall, and of the travel over which a contact may give.
_VELOCITIES = (0.05, 0.2, 0.6)
_GIVES = (0.01, 0.05)
#: Orders of the angle that friction may vary with, from this many nats that they promise; share by which it
#: varies in the beginning, and phases, of which a wrong one leads back to none.
_ORDERS, _PROMISES, _VARIES = 2, 12.0, 0.3
_PHASES = (0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi)


def richer_forms(
    fits: Sequence[Fit], before: Fit, index: int, records: Sequence[Record], scales: Scales, limits: Limits
) -> list[Fit]:
    """Fits of the richer forms of the plain friction among ``fits`` (one a place) that promise more than it,
    one of each form; ``before``: the model without it, ``index``: its place among the effects."""
    found = []
    for fit in fits:
        effect = fit.model.effects[index]
        if effect.effect != "coulomb_friction" or fit.log_likelihood < before.log_likelihood + _STRONG:
            continue
        plain = fit_whole(fit.model, fit.noise, records, free=fit.free, iterations=_STEPS, limits=limits)
        if not effect.parameters["torque"] > 0.0:
            continue
        forms = [*_forms(effect, scales), *_rippled(plain, index, records, scales)]

        def fitted(form: Effect, fit: Fit = fit, plain: Fit = plain) -> Fit:
            wider = _instead(fit.model, index, form)
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


def _forms(plain: Effect, scales: Scales) -> Iterator[Effect]:
    """Richer forms of about the size of a plain friction."""
    torque, place = plain.parameters["torque"], plain.location
    contact = {k: v for k, v in plain.parameters.items() if k in ("contact_angle", "smoothing")}
    for share in _VELOCITIES:
        velocity = share * scales.size["velocity"]
        own = {"coulomb": 0.6 * torque, "breakaway": 1.1 * torque, "velocity": velocity}
        yield Effect("stribeck_friction", place, {**own, **contact})
    for more, less in ((1.2, 0.8), (0.8, 1.2)):
        own = {"positive": more * torque, "negative": less * torque}
        yield Effect("asymmetric_friction", place, {**own, **contact})
    for share in _GIVES:
        gives = share * scales.span(1 if place.endswith("_arm") else 0)
        yield Effect("presliding_friction", place, {"torque": torque, "stiffness": torque / gives})


def _rippled(plain: Fit, index: int, records: Sequence[Record], scales: Scales) -> Iterator[Effect]:
    """The plain friction of a fit, varying with the angle: at the orders that promise most beside it."""
    effect = plain.model.effects[index]
    if not effect.parameters["torque"] > 0.0:
        return
    entry = EFFECTS["position_dependent_friction"]
    parameter = next(p for p in entry.parameters if p.scan)
    place = effect.location.rpartition("_")[2]
    orders = list(scanned_values(parameter, scales, place))
    if not orders:
        return
    gains = Answers(plain, records).gains(entry, parameter, place, orders)
    torque, contact = effect.parameters["torque"], {"contact_angle": effect.values["contact_angle"]}
    for i in np.argsort(-gains)[:_ORDERS]:
        if gains[i] > _PROMISES:
            for phase in _PHASES:
                own = {"torque": torque, "amplitude": _VARIES * torque, "order": orders[i], "phase": phase}
                yield Effect(entry.name, effect.location, {**own, **contact})


def _instead(model: Model, index: int, effect: Effect) -> Model:
    """The model with another effect in that place."""
    old = model.effects[index]
    head = f"{old.location}.{old.effect}."
    fixed = tuple(name for name in model.fixed if not name.startswith(head))
    effects = (*model.effects[:index], effect, *model.effects[index + 1 :])
    return replace(model, effects=effects, fixed=fixed)
