"""What an effect's torque follows from: the motion, the input of the actuator, or one quantity alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from haptic_teleop_sim.effects import EffectEntry
from haptic_teleop_sim.effects.on_arrays import NUMERIC
from haptic_teleop_sim.model import Effect, Model


def follows_from_motion(entry: EffectEntry) -> bool:
    """Whether the effect is a torque that its equation gives along a motion, without states of its own."""
    return (
        entry.kind in ("torque", "friction", "relative_inertia")
        and entry.equation is not None
        and entry.where != ("actuator",)
        and not (entry.rates or entry.nuisance or entry.unnamed or entry.exogenous)
    )


def follows_from_input(entry: EffectEntry) -> bool:
    """Whether the effect is what an actuator makes of its input, less of it the smaller its size (a limit has
    no such size, and a gain is that of all torques)."""
    return entry.kind == "input" and not entry.unnamed and entry.parameters[0].neutral == 0.0


def own_variable(model: Model, effect: Effect) -> tuple[str, str] | None:
    """The variable of a `torque_map` that an effect's law is over, and the place at which a torque over it
    acts like the effect; None for what is no torque over one quantity, and beside a map of the user's own.
    What an actuator makes of its input, late or not, is over the torque that acts."""
    entry, place = effect.entry, model.place(effect.location)
    if entry.rates or entry.exogenous or any(e.entry.tabulated for e in model.effects):
        return None
    if place == "actuator":
        return ("input", "motor") if entry.kind == "input" and entry.follows.startswith("input") else None
    if entry.kind not in ("torque", "friction") or entry.follows not in ("velocity", "angle", "deflection"):
        return None
    quantity = "deflection_rate" if (place, entry.follows) == ("joint", "velocity") else entry.follows
    return (quantity, place) if _is_over(effect, quantity) else None


def _is_over(effect: Effect, quantity: str) -> bool:
    """Whether the effect's torque follows that quantity, and no other: where everything else changes, it does
    not, and it is no constant. Dry friction turns with its velocity."""
    equation, random = effect.entry.equation, np.random.default_rng(1)
    if equation is None:
        return False
    values = {p.name: 1.0 if p.default is None else p.default for p in effect.entry.parameters}
    numbers = SimpleNamespace(**{**values, **effect.parameters})
    names = ("position", "velocity", "deflection", "deflection_rate", "acceleration", "time", "input")
    at = {name: random.uniform(0.2, 1.0, 40) for name in names}
    # Both sides, and beyond what the effect begins at.
    angles = [abs(getattr(numbers, p.name)) for p in effect.entry.parameters if p.unit == "rad"]
    reach = 2.0 * max([1.0, *angles])
    for name in ("position", "deflection"):
        at[name] = random.uniform(-reach, reach, 40)
    own = {"angle": "position", "deflection_rate": "velocity"}.get(quantity, quantity)
    held = {own: np.repeat(at[own][:20], 2)}
    if quantity == "deflection":
        held["position"] = held[own]  # at the joint they are one
    rest = {"stiffness": 1.0, "exogenous": 0.0, "state0": 0.0, "state1": 0.0}
    variables = SimpleNamespace(**{**at, **held, **rest, **NUMERIC})
    turned = own == "velocity"
    variables.direction = np.sign(variables.velocity) if turned else random.choice([-1.0, 1.0], 40)
    with np.errstate(all="ignore"):
        first = np.broadcast_to(np.asarray(equation(variables, numbers), dtype=np.float64), 40)
        for name in ("velocity", "direction") if turned else ():
            setattr(variables, name, -getattr(variables, name))
        other = np.broadcast_to(np.asarray(equation(variables, numbers), dtype=np.float64), 40)
    same = bool(np.allclose(first[::2], first[1::2]))
    return same and (not np.allclose(first, first[0]) or not np.allclose(first, other))


def is_lateness(entry: EffectEntry) -> bool:
    """Whether all that the effect does is to move a channel in time, or to smear it."""
    own = [p for p in entry.parameters if p.default is None]
    return entry.kind in ("input", "output", "skew") and [p.unit for p in own] == ["s"]
