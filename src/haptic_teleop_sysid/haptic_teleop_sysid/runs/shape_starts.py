"""Starts over the shapes of a model's effects, which a fit from one start cannot climb to.

A friction that falls with speed over a velocity of 0.05 rad/s is fitted to a hill of its own, far below the
one at the true 0.15 rad/s, and its standard errors say nothing of that. An effect's entry lists where its
hills lie (`EffectParameter.grid`), on scales of the recordings.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.diagnosis.inputs.scales import Scales, recording_scales
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits, bounds

#: The largest of what a typical size is of: a joint that mostly rests moves far faster than on average.
_LARGEST = {"velocity": "fastest", "torque": "peak"}
#: Two starts closer than this factor are one.
_APART = 1.5


def shape_starts(model: Model, records: Sequence[Record], limits: Limits | None = None) -> list[Model]:
    """The model with each free shape of its effects at the other values of its grid, one shape at a time;
    empty for a model without such shapes. What a recording is scanned for (an order) is taken as stated."""
    shapes = {
        f"{effect.location}.{effect.effect}.{p.name}": p
        for effect in model.effects
        for p in effect.entry.parameters
        if p.grid and p.neutral is None and not p.scan
    }
    names = [name for name in model.free_parameters() if name in shapes]
    if not names:
        return []
    scales = recording_scales(model, records)
    found = []
    for name, low, high in zip(names, *bounds(model, names, limits), strict=True):
        tried = [model.parameter_values()[name]]
        for size in _sizes(scales, shapes[name].scale):
            for share in shapes[name].grid:
                value = float(np.clip(share * size, low, high))
                if all(not 1.0 / _APART < value / one < _APART for one in tried if one):
                    tried.append(value)
        found += [model.with_values({name: value}) for value in tried[1:]]
    return found


def _sizes(scales: Scales, scale: str) -> list[float]:
    return [scales.size[one] for one in (scale, _LARGEST.get(scale, "")) if one in scales.size]
