"""What an effect's equation depends on, seen from a few samples of it."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EFFECTS, EffectEntry
from haptic_teleop_sim.effects.on_arrays import NUMERIC

FloatArray = NDArray[np.float64]


def linear(entry: EffectEntry, size: str) -> bool:
    """Whether the equation is linear in its size."""
    p = {q.name: 1.0 if q.default is None else q.default for q in entry.parameters}
    one, two = (_sampled(entry, {**p, size: value}) for value in (0.5, 1.0))
    return bool(np.allclose(2.0 * one, two))


def _sampled(entry: EffectEntry, values: dict[str, float]) -> FloatArray:
    """An effect's torques at three points of a motion."""
    x = np.array([-0.7, 0.3, 0.9])
    s = SimpleNamespace(
        position=x,
        velocity=-x,
        deflection=x,
        deflection_rate=-x,
        input=x,
        stiffness=1.0,
        time=x,
        direction=np.sign(x),
        **NUMERIC,
    )
    assert entry.equation is not None
    torque = np.asarray(entry.equation(s, SimpleNamespace(**values)), dtype=float)
    return np.broadcast_to(torque, x.shape)


@cache
def apart_from_shape(name: str) -> list[str]:
    """The first sizes of an effect whose torques are the same at every shape, such as the mean of a friction
    that varies along the angle."""
    entry = EFFECTS[name]
    if entry.kind == "relative_inertia":
        return []
    sizes = [q.name for q in entry.parameters if q.default is None and q.neutral == 0.0]
    shapes = [{q.name: 0.0 if q.name in sizes else step for q in entry.parameters} for step in (0.31, 1.7)]
    apart = []
    for size in sizes:
        one, other = (_sampled(entry, {**shape, size: 1.0}) for shape in shapes)
        if not np.array_equal(one, other):
            break
        apart.append(size)
    return apart
