"""Screening: one linearisation per candidate says what a fit of it could gain.

At a small size of the candidate the innovations and their derivatives by the structure's parameters *and* the
candidate's are computed; the best linear combination of them explains part of the innovations that the
structure alone cannot (score test, Rao 1948, in the whitened innovations; the structure's parameters are
projected out because a re-fit would absorb them).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Prediction, pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.gauss_newton import gauss_newton_step
from haptic_teleop_sysid.estimation.likelihood import FAILURES, innovations, log_likelihood
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.prediction_fit import OVERFLOW
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import bounds
from haptic_teleop_sysid.estimation.whitening import whiten

from ..hypotheses.candidates import shape_parameters

#: Step of a difference, as a share of the parameter, and what stands for one at zero.
_STEP, _LEAST = 1e-4, 1e-2


@dataclass(frozen=True)
class Screened:
    """A candidate with the gain (nats) its linearisation promises and the parameters it would then have;
    ``start``: the candidate as it was linearised."""

    effect: Effect
    gain: float
    start: Effect


def screen(
    fit: Fit, records: Sequence[Record], effects: Iterable[Effect], progress: Callable[[], None] | None = None
) -> list[Screened]:
    """Candidates by promised gain, best first; those whose best size has the wrong sign, or whose arithmetic
    fails, are left out."""
    packed = pack(fit.model)
    # The derivatives by the structure's parameters hardly change with a small effect: one run serves for all.
    structure = []
    for record in records:
        try:
            prediction = innovations(packed, fit.noise, record, fit.free)
            if not np.max(np.abs(prediction.d_innovation), initial=0.0) < OVERFLOW:
                return []
            slopes = whiten(packed, record, prediction.innovation, prediction.d_innovation)[1]
        except FAILURES:
            return []
        structure.append(_Structure(prediction, slopes, slopes.T @ slopes))

    def scored(effect: Effect) -> Screened | None:
        try:
            found = _score(fit, records, effect, structure)
        except FAILURES:
            found = None
        if progress is not None:
            progress()
        return found

    result = [found for found in side_by_side(scored, effects) if found is not None]
    return sorted(result, key=lambda s: -s.gain)


@dataclass(frozen=True)
class _Structure:
    """What the model without the candidate predicts of a recording, its whitened derivatives (m, p) by the
    structure's parameters, and their products (p, p)."""

    prediction: Prediction
    slopes: NDArray[np.float64]
    information: NDArray[np.float64]


@dataclass(frozen=True)
class _Answer:
    """Innovations (n, 2) with a candidate, and their derivatives (n, 2, own parameters)."""

    innovation: NDArray[np.float64]
    d_innovation: NDArray[np.float64]


def _score(
    fit: Fit, records: Sequence[Record], effect: Effect, structure: Sequence[_Structure]
) -> Screened | None:
    model = fit.model.with_effects(effect)
    shapes = shape_parameters(effect.entry)
    head = f"{effect.location}.{effect.effect}."
    own = [head + n for n in effect.parameters if n not in shapes]
    packed = pack(model)
    predictions = [
        _by_differences(model, own, fit, record, before.prediction.innovation)
        for record, before in zip(records, structure, strict=True)
    ]
    if not all(np.all(np.isfinite(p.innovation)) for p in predictions):
        return None
    known, size = len(fit.free), len(fit.free) + len(own)
    information, gradient = np.zeros((size, size)), np.zeros(size)
    for record, prediction, before in zip(records, predictions, structure, strict=True):
        reference = before.prediction
        if not np.max(np.abs(prediction.d_innovation), initial=0.0) < OVERFLOW:
            return None
        # In units of what is left without the effect: at a size that is large against the noise, the effect's
        # own innovations would hide what it could explain at a smaller one.
        whitened, slopes = whiten(
            packed, record, prediction.innovation, prediction.d_innovation, reference.innovation
        )
        # One product for both: of a single column alone it takes many times as long.
        own_and_error = np.column_stack([slopes, whitened])
        among, mixed = own_and_error.T @ own_and_error, before.slopes.T @ own_and_error
        information[:known, :known] += before.information
        information[known:, known:] += among[:-1, :-1]
        information[:known, known:] += mixed[:, :-1]
        information[known:, :known] += mixed[:, :-1].T
        gradient[:known] += mixed[:, -1]
        gradient[known:] += among[:-1, -1]
    step = gauss_newton_step(information, gradient, 1e-9, np.ones(size, dtype=bool))
    promised = [
        p.innovation
        + _along(before.prediction.d_innovation, step[:known])
        + _along(p.d_innovation, step[known:])
        for p, before in zip(predictions, structure, strict=True)
    ]
    gain = log_likelihood(packed, records, promised) - fit.log_likelihood
    sizes = {
        n.removeprefix(head): model.parameter_values()[n] + step[len(fit.free) + i] for i, n in enumerate(own)
    }
    start = _polar(effect, sizes)
    low, high = bounds(model, tuple(own))
    new = {**effect.parameters, **start}
    for n, a, b in zip(own, low, high, strict=True):
        name = n.removeprefix(head)
        if name == "phase":
            continue
        if not a <= new[name] <= b:
            # The best size lies beyond the bound: worth nothing if it is the size that is negative.
            edge = a if new[name] < a else b
            if name in _sizes(effect) and edge == 0.0:
                return None
            new[name] = float(np.clip(new[name], a, b))
    return Screened(Effect(effect.effect, effect.location, _alike_in_shape(effect, new)), gain, effect)


def _alike_in_shape(start: Effect, new: dict[str, float]) -> dict[str, float]:
    """New parameters of an effect; a contact that builds up over a displacement does so over the same one."""
    if start.entry.memory != "ratio":
        return new
    torque, stiffness = start.entry.parameters[:2]
    stiffer = start.parameters[stiffness.name] * new[torque.name] / start.parameters[torque.name]
    return {**new, stiffness.name: stiffness.within(stiffer)}


def _by_differences(
    model: Model, own: Sequence[str], fit: Fit, record: Record, without: NDArray[np.float64]
) -> _Answer:
    """Innovations (n, 2) with the effect, and their derivatives (n, 2, own) by differences: a run without
    derivatives costs a third of one with them. By a size that is none at zero the difference is that from
    the innovations ``without`` the effect (n, 2), which are there already."""
    effect = model.effects[-1]

    def errors(moved: Model) -> NDArray[np.float64]:
        return innovations(pack(moved), fit.noise, record).innovation

    here, sizes, values = errors(model), _sizes(effect), model.parameter_values()
    slopes = np.empty((*here.shape, len(own)))
    for i, name in enumerate(own):
        value, short = values[name], name.rpartition(".")[2]
        if short in sizes and value != 0.0:
            slopes[:, :, i] = (here - without) / value
            continue
        step = _STEP * max(abs(value), _LEAST)
        if value + step > effect.entry.parameter(short).maximum:
            step = -step
        slopes[:, :, i] = (errors(model.with_values({name: value + step})) - here) / step
    return _Answer(here, slopes)


def _along(slopes: NDArray[np.float64], step: NDArray[np.float64]) -> NDArray[np.float64]:
    """What a step (p,) changes of innovations (n, 2) by their derivatives (n, 2, p): one product of a matrix,
    not one of each sample."""
    if not len(step):
        return np.zeros(slopes.shape[:2])
    return (slopes.reshape(-1, len(step)) @ step).reshape(slopes.shape[:2])


def _sizes(effect: Effect) -> tuple[str, ...]:
    """The parameters whose sign makes sense or not, of effects with a single one."""
    names = [
        p.name
        for p in effect.entry.parameters
        if p.default is None and p.neutral == 0.0 and p.name in effect.parameters
    ]
    return tuple(names) if len(names) == 1 else ()


def _polar(effect: Effect, sizes: dict[str, float]) -> dict[str, float]:
    """A step in (amplitude, phase) at small amplitude is one in (sine, cosine): turned back into amplitude
    and phase.
    """
    if "phase" not in sizes or "amplitude" not in sizes:
        if "phase" in sizes and "torque" in sizes:
            return _polar_named(effect, sizes, "torque")
        return sizes
    return _polar_named(effect, sizes, "amplitude")


def _polar_named(effect: Effect, sizes: dict[str, float], name: str) -> dict[str, float]:
    old = float(effect.parameters[name])
    phase = float(effect.parameters["phase"])
    sine, cosine = sizes[name], old * (sizes["phase"] - phase)
    return {**sizes, name: math.hypot(sine, cosine), "phase": phase + math.atan2(cosine, sine)}


def best_per_effect(screened: Iterable[Screened]) -> list[Screened]:
    """The best start of each effect at each place."""
    seen: dict[tuple[str, str], Screened] = {}
    for s in screened:
        key = (s.effect.effect, s.effect.location)
        if key not in seen or s.gain > seen[key].gain:
            seen[key] = s
    return sorted(seen.values(), key=lambda s: -s.gain)
