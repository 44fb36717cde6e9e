"""What sizes are off by because a law has more than one published form.

Friction that falls with speed is written as a hyperbolic secant, as a Gauss curve or as an exponential of
the speed. Along one motion all of them follow each other closely, with other sizes: what friction is at the
speeds that were reached is known, what it would be far above them is not, and what a standard error says of
the one form says nothing of the others. So the torque that was found is written in each other form along the
recorded motion, the structure's own torques beside it, and the sizes that this takes are compared. Of a stop
it is the place that is compared: how stiff another law is has another unit.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EffectEntry, EffectParameter
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record

from .inverse_dynamics.band import highest_cutoff
from .inverse_dynamics.products import solved
from .inverse_dynamics.regression import Equations, equations, signs
from .inverse_dynamics.terms import Hypothesis

FloatArray = NDArray[np.float64]

#: Times the band of the motion in which the forms are compared: near a reversal they differ most.
WIDER = 4.0
#: Factors by which a shape (a velocity) may differ between forms, and how far a place may, as a share of the
#: way that the motion goes beyond it.
_SHAPES = np.geomspace(0.25, 4.0, 25)
_PLACES = np.linspace(-0.5, 0.5, 51)


def spread_by_form(model: Model, records: Sequence[Record], cutoff: float) -> dict[str, float]:
    """By full parameter name, in its unit: how much sizes of the model's effects, and the structure's free
    parameters beside them, differ between the published forms of a law (root mean square over the other
    forms); empty where no effect has another form, or the arithmetic of the regression fails. ``cutoff``: Hz,
    of the band of the motion."""
    several = [e for e in model.effects if e.entry.other_forms]
    if not several:
        return {}
    bare = replace(model, effects=(), fixed=tuple(n for n in model.fixed if "." not in n))
    try:
        side = equations(bare, records, min(WIDER * cutoff, highest_cutoff(records)))
        return _differences(side, several)
    except FAILURES:
        return {}


def _differences(side: Equations, several: Sequence[Effect]) -> dict[str, float]:
    found: dict[str, float] = {}
    for effect in several:
        squares: dict[str, float] = {}
        for form in effect.entry.other_forms:
            for name, apart in _apart(side, effect, replace(effect.entry, equation=form)).items():
                squares[name] = squares.get(name, 0.0) + apart**2 / len(effect.entry.other_forms)
        for name, square in squares.items():
            found[name] = float(np.hypot(found.get(name, 0.0), np.sqrt(square)))
    return found


def together(one: Mapping[str, float], other: Mapping[str, float]) -> dict[str, float]:
    """Two independent standard deviations of each parameter as one; by name, of either alone where only that
    is there."""
    return {n: float(np.hypot(one.get(n, 0.0), other.get(n, 0.0))) for n in {**one, **other}}


def _apart(side: Equations, effect: Effect, entry: EffectEntry) -> dict[str, float]:
    """What the parameters change by when the effect's torque is written in the form of ``entry``, at the
    shape that comes nearest."""
    place = side.model.place(effect.location)
    sign = np.array(signs(place, side.model.rigid))

    def rows(torque: FloatArray) -> FloatArray:
        """(equations n, columns), of torques (n, columns) at the effect's place."""
        return np.concatenate([s * torque for s in sign])

    given = rows(side.torque(Hypothesis.of(effect, place)))[:, 0]
    base = np.concatenate([*side.base])
    best, least, nearest = np.zeros(0), np.inf, dict[str, float]()
    sizes = tuple(p.name for p in entry.parameters if p.default is None and p.neutral == 0.0)
    kept = tuple((n, v) for n, v in effect.values.items() if entry.parameter(n).default is not None)
    for shape in _shapes(effect, entry, side, place):
        other = Hypothesis(entry, effect.location, place, (*shape, *kept), sizes, None)
        columns = np.column_stack([base, rows(side.torque(other))])
        low = np.concatenate([np.full(base.shape[1], -np.inf), other.bounds()[0]])
        values = solved(columns.T @ columns, columns.T @ given, low, np.full(len(low), np.inf))
        left = float(np.sum((given - columns @ values) ** 2))
        if left < least:
            best, least, nearest = values, left, dict(shape)
    if not np.isfinite(least):
        return {}
    head = f"{effect.location}.{effect.effect}."
    apart = {n: abs(float(v)) for n, v in zip(side.names, best, strict=False)}
    places = [p.name for p in entry.parameters if _is_place(p)]
    if places:
        return apart | {head + n: abs(nearest[n] - effect.values[n]) for n in places}
    own = best[len(side.names) :]
    return apart | {head + n: abs(float(v) - effect.values[n]) for n, v in zip(sizes, own, strict=True)}


def _is_place(parameter: EffectParameter) -> bool:
    return parameter.scan == "furthest"


def _shapes(
    effect: Effect, entry: EffectEntry, side: Equations, place: str
) -> Iterator[tuple[tuple[str, float], ...]]:
    """The effect's shape parameters at which a form is tried."""
    shaped = [p for p in entry.parameters if p.default is None and p.neutral is None]

    def tried(p: EffectParameter) -> FloatArray:
        value = effect.values[p.name]
        if not _is_place(p):
            return _SHAPES * value
        column = 1 if place == "arm" else 0
        furthest = max(float(np.max(np.sign(value) * m.angle[:, column])) for m in side.motions)
        return value + _PLACES * max(furthest - abs(value), 0.0)

    for values in itertools.product(*(tried(p) for p in shaped)):
        yield tuple((p.name, float(v)) for p, v in zip(shaped, values, strict=True))
