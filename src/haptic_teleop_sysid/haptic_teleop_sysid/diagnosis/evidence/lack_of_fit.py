"""Lack of fit of a law: what would a curve over the quantity that an effect follows gain beside it?

A magnet's pull that is a sine of the deflection wins against all names as a cubic spring, a brake beyond its
peak as dry friction, and a torque that builds up faster than it goes as a lag. The curve says that the law is
another one. Its torques are hats, one at each of some knots; the innovations answer to each as they do to a
small torque like it, and a score test (Rao 1948) says what all of them together would gain, with the same
torques on all recordings and all free parameters projected out. Inputs and predictions of the observer are
known before the innovation, so this is right in a closed loop, too, as far as what else is missing is random.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.effects.torque_map import TorqueMap
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit, whiten
from haptic_teleop_sysid.estimation.likelihood import FAILURES, innovations, settled
from haptic_teleop_sysid.estimation.records import Record

FloatArray = NDArray[np.float64]

#: Knots of a curve, at these quantiles of its quantity on all recordings, and at least this share of its
#: range apart.
KNOTS = np.linspace(0.005, 0.995, 9)
_APART, _FEWEST = 0.02, 4
#: Torque of a hat, as a share of the rms input torque: small against what changes how the observer answers.
_SMALL = 1e-3
#: Nats that a knot gains by chance, on data it was fitted to.
_BY_CHANCE = 2.0
#: Share of the largest singular value from which curves count as combinations of others.
_SAME = 1e-6


def own_quantity(model: Model, effect: Effect) -> tuple[str, str] | None:
    """The variable of a `torque_map` that an effect's law is drawn over, and the place at which a torque over
    it acts like the effect; None for what is no torque over one quantity."""
    entry, place = effect.entry, model.place(effect.location)
    if entry.kind not in ("torque", "friction", "input") or entry.rates or entry.exogenous:
        return None
    if any(e.entry.tabulated for e in model.effects):
        return None
    if place == "actuator":
        return ("input", "motor") if entry.follows.startswith("input") else None
    if entry.follows not in ("velocity", "angle", "deflection"):
        return None
    quantity = "deflection_rate" if (place, entry.follows) == ("joint", "velocity") else entry.follows
    return quantity, place


def lack_of_fit(fits: Sequence[tuple[Fit, Sequence[Record]]], effect: Effect) -> float | None:
    """Nats that a curve over the effect's own quantity gains beside it on all recordings, net of chance; None
    for what has no such quantity, or where arithmetic fails. ``fits``: the model with the effect, with the
    noise levels of each kind of recordings, and with what is free there beside the curve."""
    own = own_quantity(fits[0][0].model, effect)
    if own is None:
        return None
    quantity, place = own
    try:
        knots = _knots([(fit, record) for fit, records in fits for record in records], quantity, place)
        if len(knots) < _FEWEST:
            return None
        size, score = np.zeros((len(knots), len(knots))), np.zeros(len(knots))
        for fit, records in fits:
            for record in records:
                more, along = _answered(fit, record, quantity, place, knots)
                size, score = size + more, score + along
        unit = np.sqrt(np.maximum(np.diag(size), 1e-300))
        best = np.linalg.lstsq(size / np.outer(unit, unit), score / unit, rcond=_SAME)[0]
    except FAILURES:
        return None
    gain = 0.5 * float(best @ (score / unit)) - _BY_CHANCE * len(knots)
    return gain if np.isfinite(gain) else None


def _values(fit: Fit, record: Record, states: FloatArray, quantity: str, place: str) -> FloatArray:
    side = int(place == "arm")
    if quantity == "input":
        return pack(fit.model).torque_constant * record.input
    if quantity.startswith("deflection"):
        ahead = 2 if quantity == "deflection_rate" else 0
        return states[:, ahead] - states[:, ahead + 1]
    return states[:, side if quantity == "angle" else 2 + side]


def _knots(both: Sequence[tuple[Fit, Record]], quantity: str, place: str) -> tuple[float, ...]:
    parts = []
    for fit, record in both:
        states = innovations(pack(fit.model), fit.noise, record).states
        parts.append(settled(record, _values(fit, record, states, quantity, place)))
    at = np.quantile(np.concatenate(parts), KNOTS)
    kept = [float(at[0])]
    for value in at[1:]:
        if value - kept[-1] > _APART * (at[-1] - at[0]):
            kept.append(float(value))
    return tuple(kept)


def _answered(
    fit: Fit, record: Record, quantity: str, place: str, knots: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Information (k, k) of the hats' torques, and what the innovations have along them (k,), by N·m; all
    free parameters projected out."""
    packed = pack(fit.model)
    run = innovations(packed, fit.noise, record, fit.free)
    small = _SMALL * abs(packed.torque_constant) * float(np.sqrt(np.mean(record.input**2)))
    if not small > 0.0:
        return np.zeros((len(knots), len(knots))), np.zeros(len(knots))
    answers = []
    for hat in np.eye(len(knots)) * small:
        table = TorqueMap((quantity,), (knots,), tuple(hat.tolist()))
        pushed = fit.model.with_effects(Effect(MEASURED.name, fit.model.location(place), table=table))
        moved = innovations(pack(pushed), fit.noise, record).innovation - run.innovation
        answers.append(moved / small)
    slopes = np.concatenate([run.d_innovation, np.stack(answers, axis=-1)], axis=2)
    errors, slopes = whiten(packed, record, run.innovation, slopes)
    known, hats = slopes[:, : len(fit.free)], slopes[:, len(fit.free) :]
    length = np.sqrt(np.sum(known**2, axis=0))
    known = np.linalg.qr(known[:, length > 0.0] / length[length > 0.0])[0]
    hats = hats - known @ (known.T @ hats)
    return hats.T @ hats, hats.T @ errors
