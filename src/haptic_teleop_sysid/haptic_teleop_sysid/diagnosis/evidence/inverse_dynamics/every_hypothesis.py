"""Every hypothesis about what is missing: each effect at each place, at the shapes of a grid."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

from haptic_teleop_sim.effects import EFFECTS, EffectEntry, EffectParameter, locations
from haptic_teleop_sim.model import Model

from ...hypotheses.candidates import BORNE, family
from ...hypotheses.follows import follows_from_input, follows_from_motion
from ...inputs.scales import Scales
from ...starts.scan import scanned_values
from .terms import Hypothesis, is_held, parts_of

#: Factor from one size in time, at which an actuator is tried, to the next.
_NEXT = math.sqrt(2.0)


def hypotheses(model: Model, scales: Scales) -> Iterator[Hypothesis]:
    """Every effect that is a torque along the motion, or what an actuator makes of the input, at every place
    it may sit where the model has none of its forms, at every shape of its grids."""
    present = {(n, e.location) for e in model.effects for n in family(e.effect)}
    for name, entry in EFFECTS.items():
        if follows_from_input(entry) and (name, model.location("actuator")) not in present:
            yield from _of_actuator(entry, model.location("actuator"), scales)
        if not follows_from_motion(entry):
            continue
        for place in locations(name, model.structure):
            location = model.location(place)
            if (name, location) not in present:
                yield from _shapes(entry, location, place, scales)


def _of_actuator(entry: EffectEntry, location: str, scales: Scales) -> Iterator[Hypothesis]:
    """Sizes from which the right one is found (see `exact_sizes`)."""
    size, *shaped = entry.parameters
    if size.unit == "s":
        number = int(math.log(size.maximum / scales.dt, _NEXT)) if size.maximum > scales.dt else 0
        sizes = [scales.dt * _NEXT**i for i in range(number + 1)]
    else:
        sizes = [g * scales.size[size.scale] for g in size.grid] or [size.typical]
    for value, *others in itertools.product(sizes, *(_grid(p, scales, "actuator") for p in shaped)):
        shape = zip((p.name for p in entry.parameters), (value, *others), strict=True)
        yield Hypothesis(entry, location, "motor", tuple(shape), (size.name,), None, held=True)


def _shapes(entry: EffectEntry, location: str, place: str, scales: Scales) -> Iterator[Hypothesis]:
    sizes, shaped, angle = parts_of(entry)
    if is_held(entry, sizes):
        size = entry.parameter(sizes[0])
        for value in size.grid:
            shape = ((size.name, value * scales.size[size.scale]),)
            yield Hypothesis(entry, location, place, shape, sizes, None, held=True)
        return
    for values in itertools.product(*([(p.name, v) for v in _grid(p, scales, place)] for p in shaped)):
        shape, gives = tuple(values), 0.0
        if entry.memory in ("ratio", "displacement"):
            name = entry.parameters[1].name
            gives = dict(shape)[name]
            if entry.memory == "ratio":
                gives = BORNE * scales.size["torque"] / gives
                shape = tuple((n, v) for n, v in shape if n != name)
        yield Hypothesis(entry, location, place, shape, sizes, angle, gives)


def _grid(parameter: EffectParameter, scales: Scales, place: str) -> list[float]:
    if parameter.scan:
        return [parameter.within(v) for v in scanned_values(parameter, scales, place)]
    return [parameter.within(g * scales.size[parameter.scale]) for g in parameter.grid]
