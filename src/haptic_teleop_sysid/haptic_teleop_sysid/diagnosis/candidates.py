"""All the effects that might be missing, each with starts from which a fit can find it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from haptic_teleop_sim.effects import EFFECTS, EffectEntry, EffectParameter, locations
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

#: Share of the typical size at which a candidate is linearised: small, but not at the bound.
SMALL = 0.05
#: Effects that do not exist at a small size without turning into another one.
_FULL_SIZE = ("presliding_friction",)


def candidates(model: Model, records: Sequence[Record], scales: dict[str, float]) -> Iterator[Effect]:
    """Every effect at every place it may sit and that the model does not have yet, at every start of its grid."""
    present = {(e.effect, e.location) for e in model.effects}
    for name, entry in EFFECTS.items():
        if entry.exogenous and not any(r.exogenous.any() for r in records):
            continue
        if name == "gain_error" and "torque_constant" not in model.fixed:
            continue  # the same thing as the torque constant, which is estimated
        for place in locations(name, model.structure):
            location = model.location(place)
            if (name, location) not in present:
                for parameters in starts(entry, scales):
                    yield Effect(name, location, parameters)


def starts(entry: EffectEntry, scales: dict[str, float]) -> Iterator[dict[str, float]]:
    """Parameters to start from: small sizes, and all combinations of the grids of shape parameters."""
    share = 1.0 if entry.name in _FULL_SIZE else SMALL
    options = [[(p.name, v) for v in _values(p, scales[p.scale], share)] for p in entry.parameters if _wanted(p)]
    for combination in itertools.product(*options):
        yield dict(combination)


def _wanted(parameter: EffectParameter) -> bool:
    return parameter.default is None or parameter.name in ("phase", "rest")


def _values(parameter: EffectParameter, scale: float, share: float) -> tuple[float, ...]:
    if parameter.grid:
        return tuple(g * scale for g in parameter.grid)
    if parameter.name in ("phase", "rest"):
        return (0.0,)
    if parameter.neutral is None:
        return (parameter.typical * scale,)
    return (parameter.neutral + share * (parameter.typical * scale - parameter.neutral),)


def shape_parameters(entry: EffectEntry) -> tuple[str, ...]:
    """Parameters that a grid covers and that a linearisation leaves where they are."""
    return tuple(p.name for p in entry.parameters if p.grid and p.neutral is None)
