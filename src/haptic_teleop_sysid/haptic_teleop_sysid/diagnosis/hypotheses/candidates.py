"""All the effects that might be missing, each with starts from which a fit can find it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

from haptic_teleop_sim.effects import EFFECTS, EffectEntry, EffectParameter, locations
from haptic_teleop_sim.effects.parameter import STICTION_ANGLE
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.records import Record

from ..inputs.scales import Scales
from .twins import twins

#: Starts by effect and place: values of a parameter that was scanned, best first.
Scanned = dict[tuple[str, str], list[float]]
#: Shares of the typical size at which a candidate is linearised: a small effect is linear only where it is
#: small, and a large one is seen better from a little way out.
SMALL = (0.002, 0.05)
#: ... and the one from which a fit starts that knows nothing.
_PLAIN = 0.1
#: Share of the rms torque that a contact bears at which its grid of stiffnesses means displacements.
BORNE = 0.01
#: Share of the travel to either end at which a stop is looked for that nothing is known of.
_WITHIN = 0.6


def family(name: str) -> set[str]:
    """The effect and all that are forms of the same thing."""
    own = EFFECTS[name]
    kin = {e.name for e in EFFECTS.values() if e.form_of == name or set(e.families) & set(own.families)}
    return {name} | kin | {own.form_of} - {""}


def candidates(
    model: Model, records: Sequence[Record], scales: Scales, scanned: Scanned | None = None
) -> Iterator[Effect]:
    """Every effect at every place it may sit, where the model has none of its family yet, nor another name of
    the same thing, at every start; ``scanned``: the starts of parameters that were scanned, instead of their
    grids."""
    same = [one for e in model.effects for one in (e, *twins(e, model.rigid))]
    present = {(n, e.location) for e in same for n in family(e.effect)}
    for name, entry in EFFECTS.items():
        if entry.nuisance or entry.tabulated:
            continue
        if entry.exogenous and not any(r.exogenous.any() for r in records):
            continue
        if entry.same_as and entry.same_as not in model.fixed:
            continue  # the same thing as a parameter of the structure, which is estimated
        for place in locations(name, model.structure):
            location = model.location(place)
            if (name, location) not in present:
                for parameters in starts(entry, scales, place, (scanned or {}).get((name, location))):
                    yield Effect(name, location, parameters)


def starts(
    entry: EffectEntry, scales: Scales, place: str, scanned: Sequence[float] | None = None
) -> Iterator[dict[str, float]]:
    """Parameters to start from: small sizes, and all combinations of the grids of shape parameters (with
    ``scanned`` values instead of the grid of the one that was scanned)."""
    shaped = any(p.grid and p.neutral is None for p in entry.parameters)
    for share in SMALL[:1] if shaped else SMALL:
        options = [
            [(p.name, v) for v in _values(entry, p, scales, place, share, scanned)]
            for p in entry.parameters
            if _wanted(p)
        ]
        own = _own_contact(entry, scales, place)
        for combination in itertools.product(*options):
            yield _over_the_same(entry, scales, {**dict(combination), **own})


def _over_the_same(entry: EffectEntry, scales: Scales, start: dict[str, float]) -> dict[str, float]:
    """The start, of a contact that builds up over a displacement with the stiffness at which its torque does
    so over that of the grid: a smaller torque at the same stiffness is another shape."""
    if entry.memory == "ratio":
        torque, stiffness = (p.name for p in entry.parameters[:2])
        factor = start[torque] / (BORNE * scales.size["torque"])
        start = {**start, stiffness: start[stiffness] * factor}
    return {n: entry.parameter(n).within(v) for n, v in start.items()}


def _own_contact(entry: EffectEntry, scales: Scales, place: str) -> dict[str, float]:
    """The contact to begin with, where the default is none on such a recording."""
    if not entry.contact:
        return {}
    channel = 1 if place == "arm" else 0
    least, most = scales.contacts(channel)
    if least <= STICTION_ANGLE <= most:
        return {}
    return {entry.contact: scales.contact_starts(channel)[1]}


def plain_start(entry: EffectEntry, scales: Scales, place: str) -> list[dict[str, float]]:
    """Parameters to start from where nothing is known: a tenth of the typical size and the middle of every
    grid (all of it where each value is another hill); stops well within the travel at either end, as hard
    as is typical: soft ones fade away."""
    stops = any(p.scale == "furthest" for p in entry.parameters)
    channel = 1 if place == "arm" else 0
    options = []
    for p in entry.parameters:
        if p.scale == "furthest":
            least = 0.1 * scales.size[p.scale]
            low, high = scales.lowest[channel], scales.highest[channel]
            ends = [end for end in (min(low, 0.0), max(high, 0.0)) if abs(end) > least]
            options.append([(p.name, _WITHIN * end) for end in ends])
        elif p.hills:
            options.append([(p.name, g * scales.size[p.scale]) for g in p.grid])
        elif _wanted(p):
            values = _values(entry, p, scales, place, 1.0 if stops else _PLAIN, None)
            options.append([(p.name, values[len(values) // 2])])
    return [_over_the_same(entry, scales, dict(combination)) for combination in itertools.product(*options)]


def dry_friction(model: Model) -> Effect:
    """Dry friction at the motor in its plainest form, of a size that says nothing."""
    plainest = next(entry for entry in EFFECTS.values() if entry.jumps)
    return Effect(plainest.name, model.location("motor"), {plainest.jumps: 1.0})


def companion(model: Model, effect: Effect) -> Effect | None:
    """What an effect may call for at the joint, of size none: what loads that at rest hides a preload of it
    where encoders are zeroed there, and the faces of a gap damp."""
    location = model.location("joint")
    if model.rigid or not effect.entry.companion:
        return None
    nuisance = EFFECTS[effect.entry.companion]
    if any(e.location == location and (e.entry.nuisance or e.effect == nuisance.name) for e in model.effects):
        return None
    return Effect(nuisance.name, location, {p.name: 0.0 for p in nuisance.parameters})


def goes_with(effect: Effect, model: Model) -> Effect | None:
    """What the model has at the joint because of an effect, see `companion`; None where it has nothing."""
    there = model.effects if effect.entry.companion and not model.rigid else ()
    location = "" if model.rigid else model.location("joint")
    return next((e for e in there if (e.effect, e.location) == (effect.entry.companion, location)), None)


def larger_starts(effect: Effect, scales: Scales) -> list[Effect]:
    """The effect at the sizes of its grids: for those that a linearisation at a small size leads astray."""
    found = []
    if any(p.neutral == math.inf for p in effect.entry.parameters):
        found.append(effect)  # a limit: it is large where it is low, and the fitted parameters have given way
    for p in effect.entry.parameters:
        if p.grid and p.neutral is not None and p.neutral == 0.0 and p.default is None:
            old = effect.parameters[p.name]
            if p.scan:
                found.append(effect)  # at the delay that was found otherwise
            for g in p.grid:
                value = p.within(g * scales.size[p.scale])
                if old == 0.0 or (value > 0.0) == (old > 0.0):
                    found.append(Effect(effect.effect, effect.location, {**effect.parameters, p.name: value}))
    return found


def contacts(effect: Effect, scales: Scales, known: float | None = None) -> list[Effect]:
    """The effect with the ``known`` contact, or every one that it may have; with and without what is optional
    in it (a stop that swallows the impact); itself where there is no such choice."""
    for p in effect.entry.parameters:
        if p.default is not None and p.grid:
            more = [{**effect.parameters, p.name: g} for g in p.grid]
            return [effect, *(Effect(effect.effect, effect.location, parameters) for parameters in more)]
    if not effect.entry.contact:
        return [effect]
    starts = scales.contact_starts(1 if effect.location.endswith("_arm") else 0)
    own, angles = effect.parameters, starts if known is None else (known,)
    return [Effect(effect.effect, effect.location, {**own, effect.entry.contact: a}) for a in angles]


def _wanted(parameter: EffectParameter) -> bool:
    return parameter.default is None or parameter.turns != ""


def _values(
    entry: EffectEntry,
    parameter: EffectParameter,
    scales: Scales,
    place: str,
    share: float,
    scanned: Sequence[float] | None,
) -> tuple[float, ...]:
    scale = scales.size[parameter.scale]
    if parameter.scan == "delay":
        # From a small one a fit climbs the nearest hill; the others are where equations hold best.
        return (share * parameter.typical * scale, *(scanned or ()))
    if parameter.scan and scanned is not None:
        return tuple(scanned)
    if parameter.scale == "furthest":
        channel = 1 if place == "arm" else 0
        ends = [v for v in (scales.highest[channel], scales.lowest[channel]) if abs(v) > 0.1 * scale]
        return tuple(g * end for end in ends for g in parameter.grid)
    if parameter.grid and (parameter.neutral is None or parameter.neutral != 0.0):
        return tuple(g * scale for g in parameter.grid)
    if parameter.turns:
        return (0.0,)
    if parameter.neutral is None:
        return (parameter.typical * scale,)
    return (parameter.neutral + share * (parameter.typical * scale - parameter.neutral),)


def shape_parameters(entry: EffectEntry) -> tuple[str, ...]:
    """Parameters that a grid (or `contacts`) covers and that a linearisation leaves where they are."""
    return tuple(
        p.name for p in entry.parameters if (p.grid and p.neutral is None) or p.name == entry.contact
    )
