"""Lack of fit of a law: what would a curve over the quantity that an effect follows gain beside it?

A magnet's pull that is a sine of the deflection wins against all names as a cubic spring, a brake beyond its
peak as dry friction, and a torque that builds up faster than it goes as a lag. The curve says that the law is
another one. Its torques are hats, one at each of some knots; the innovations answer to each as they do to a
small torque like it, and a score test (Rao 1948) says what all of them together would gain, with the same
torques, and the same changes of all free parameters beside them, on all recordings. Inputs and predictions of
the observer are known before the innovation, so this is right in a closed loop, too, as far as what else is
missing is random.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.effects.torque_map import TorqueMap
from haptic_teleop_sim.kernel import acting_torque, pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, after_settling, innovations
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whitening import whiten

from ..hypotheses.follows import own_variable

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
_SAME = 1e-3
#: Rows that are made triangular at once.
_BLOCK = 50_000


def lack_of_fit(fits: Sequence[tuple[Fit, Sequence[Record]]], effect: Effect) -> float | None:
    """Nats that a curve over the effect's own quantity gains beside it on all recordings, net of chance; None
    for what has no such quantity, or where arithmetic fails. ``fits``: the model with the effect, with the
    noise levels of each kind of recordings, and what is free beside the curve."""
    own = own_variable(fits[0][0].model, effect)
    if own is None:
        return None
    quantity, place = own
    try:
        both = [(fit, record) for fit, records in fits for record in records]
        knots = _knots(both, quantity, place)
        if len(knots) < _FEWEST:
            return None
        free = len(fits[0][0].free)
        each = [_answered(fit, record, quantity, place, knots) for fit, record in both]
        rows = np.vstack(each)
        known, hats, errors = rows[:, :free], rows[:, free:-1], rows[:, -1]
        length = np.sqrt(np.sum(known**2, axis=0))
        known = np.linalg.qr(known[:, length > 0.0] / length[length > 0.0])[0]
        hats, errors = (part - known @ (known.T @ part) for part in (hats, errors))
        there = np.sqrt(np.sum(hats**2, axis=0)) > 0.0
        best = np.linalg.lstsq(hats[:, there], errors, rcond=_SAME)[0]
    except FAILURES:
        return None
    gain = 0.5 * float(np.sum((hats[:, there] @ best) ** 2)) - _BY_CHANCE * np.count_nonzero(there)
    return float(gain) if np.isfinite(gain) else None


def _values(fit: Fit, record: Record, states: FloatArray, quantity: str, place: str) -> FloatArray:
    side = int(place == "arm")
    if quantity == "input":
        return acting_torque(pack(fit.model), record.input, record.dt, record.start)
    if quantity.startswith("deflection"):
        ahead = 2 if quantity == "deflection_rate" else 0
        return states[:, ahead] - states[:, ahead + 1]
    return states[:, side if quantity == "angle" else 2 + side]


def _knots(both: Sequence[tuple[Fit, Record]], quantity: str, place: str) -> tuple[float, ...]:
    parts = []
    for fit, record in both:
        states = innovations(pack(fit.model), fit.noise, record).states
        parts.append(after_settling(record, _values(fit, record, states, quantity, place)))
    at = np.quantile(np.concatenate(parts), KNOTS)
    kept = [float(at[0])]
    for value in at[1:]:
        if value - kept[-1] > _APART * (at[-1] - at[0]):
            kept.append(float(value))
    return tuple(kept)


def _answered(
    fit: Fit, record: Record, quantity: str, place: str, knots: tuple[float, ...]
) -> FloatArray:
    """How the innovations answer to the free parameters and to the hats' torques, by N·m, and what they are,
    in units of their standard deviation: rows (p + k + 1, p + k + 1) with the products of all samples."""
    packed = pack(fit.model)
    run = innovations(packed, fit.noise, record, fit.free)
    small = _SMALL * abs(packed.torque_constant) * float(np.sqrt(np.mean(record.input**2)))
    if not small > 0.0:
        return np.zeros((0, len(fit.free) + len(knots) + 1))
    free = len(fit.free)
    slopes = np.empty((*run.innovation.shape, free + len(knots)))
    slopes[:, :, :free] = run.d_innovation
    for k, hat in enumerate(np.eye(len(knots)) * small):
        table = TorqueMap((quantity,), (knots,), tuple(hat.tolist()))
        pushed = fit.model.with_effects(Effect(MEASURED.name, fit.model.location(place), table=table))
        moved = innovations(pack(pushed), fit.noise, record).innovation - run.innovation
        slopes[:, :, free + k] = moved / small
    errors, slopes = whiten(packed, record, run.innovation, slopes)
    rows = np.zeros((0, slopes.shape[1] + 1))
    for start in range(0, len(errors), _BLOCK):
        block = slice(start, start + _BLOCK)
        rows = np.linalg.qr(np.vstack([rows, np.column_stack([slopes[block], errors[block]])]), mode="r")
    return np.asarray(rows, dtype=np.float64)
