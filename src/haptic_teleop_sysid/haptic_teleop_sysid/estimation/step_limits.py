"""How far parameters may go: their bounds, one step, and the stiffness that is worth its time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import STRUCTURES, Model

from .records import Record

FloatArray = NDArray[np.float64]

#: A parameter of the structure moves at most by this factor in one step.
_LARGEST_FACTOR = 4.0
#: A trial stiffer than this (steps per sample), and four times stiffer than the start, is not worth its time.
_MOST_SUBSTEPS = 32
#: Bounds of one's own by parameter name: (lowest, highest).
Limits = Mapping[str, tuple[float, float]]


def bounds(model: Model, free: Sequence[str], own: Limits | None = None) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest allowed value of each free parameter, (p,), (p,): the physical ones, narrowed by
    ``own``."""
    limits = {
        f"{e.location}.{e.effect}.{p.name}": (p.minimum, p.maximum)
        for e in model.effects
        for p in e.entry.parameters
    }
    for name in STRUCTURES[model.structure]:
        positive = name in ("torque_constant", "stiffness", "motor_inertia", "arm_inertia")
        limits[name] = (1e-12 if positive else 0.0, np.inf)
    for name, (low, high) in (own or {}).items():
        if name in limits:
            limits[name] = (max(low, limits[name][0]), min(high, limits[name][1]))
    lowest, highest = zip(*(limits[name] for name in free), strict=True) if free else ((), ())
    return np.array(lowest, dtype=float), np.array(highest, dtype=float)


def at_bound(names: Sequence[str], theta: FloatArray, low: FloatArray, high: FloatArray) -> tuple[str, ...]:
    """Names of the parameters that ended at their bounds, all (p,) or longer."""
    return tuple(n for n, t, a, b in zip(names, theta, low, high, strict=False) if t <= a or t >= b)


def clipped_step(
    model: Model, names: Sequence[str], theta: FloatArray, new: FloatArray, records: Sequence[Record]
) -> FloatArray:
    """``new`` (p,) brought as near to ``theta`` (p,) as one step may go: a positive quantity changes by a
    factor, a torque by as much as acts."""
    factors = np.array([_scales(model, n) for n in names], dtype=bool)
    limit = np.maximum(np.abs(theta), 1e-12)
    lowest, highest = theta - limit * (1 - 1 / _LARGEST_FACTOR), theta + limit * (_LARGEST_FACTOR - 1)
    near = np.where(factors, np.clip(new, lowest, highest), new)
    reach = np.array([_reach(model, n, records) for n in names])
    farthest = np.maximum(3 * np.abs(theta), reach)
    return np.clip(near, theta - farthest, theta + farthest)


def most_substeps(model: Model, records: Sequence[Record]) -> int:
    """Steps per sample beyond which a trial from ``model`` is not worth its time."""
    return max(_MOST_SUBSTEPS, 4 * substeps(model, records))


def substeps(model: Model, records: Sequence[Record]) -> int:
    """Steps per sample that the model's stiffness asks for."""
    packed = pack(model)
    return max(packed.substeps(record.dt) for record in records)


def _scales(model: Model, name: str) -> bool:
    """Whether a parameter is a positive quantity without which the model has no meaning: it changes in
    factors."""
    if name in STRUCTURES[model.structure]:
        return True
    parameter = _effect_parameter(model, name)
    return parameter is not None and parameter.neutral is None and parameter.minimum > 0.0


def _reach(model: Model, name: str, records: Sequence[Record]) -> float:
    """How far one step may go from zero: for a torque as much as acts, else without limit."""
    parameter = _effect_parameter(model, name)
    if parameter is None or parameter.scale != "torque":
        return np.inf
    return float(np.max([np.std(r.input) for r in records])) * model.parameters["torque_constant"]


def _effect_parameter(model: Model, name: str):
    for effect in model.effects:
        head = f"{effect.location}.{effect.effect}."
        if name.startswith(head):
            return effect.entry.parameter(name.removeprefix(head))
    return None
