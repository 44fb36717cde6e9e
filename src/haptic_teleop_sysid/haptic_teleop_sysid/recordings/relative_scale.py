"""Parameters that a recording knows only relative to one that the model file fixes.

Torques, inertias, dampings and stiffnesses that are all multiplied by one number give the same motion, so the
recording holds their ratios, and the fixed one their size: its error comes back in all of them, one to one.
The arm's equation, with both angles measured, has such a scale of its own, in which the stiffness is the only
torque.
"""

from __future__ import annotations

from haptic_teleop_sim.model import STRUCTURES, Model

_TORQUES = ("N*m", "kg*m^2")
"""How units begin of what is a torque by an angle, a velocity, an acceleration or by nothing."""


def relative_to(model: Model, name: str) -> str:
    """The full name of the fixed parameter whose relative error a free one takes over; "" where there is
    none, or more than one. A torque constant of 1 is none: the input itself is the torque."""
    values, places = model.parameter_values(), _scaled(model)
    free = model.free_parameters()
    if name not in free or name not in places:
        return ""
    holding = [n for n in places if n not in free and values[n] != 0.0]
    tables = [model.place(e.location) for e in model.effects if e.table is not None]
    if len(holding) + len(tables) != 1 and places[name] != "motor":
        holding = [n for n in holding if n == "stiffness" or places[n] != "motor"]
        tables = [place for place in tables if place != "motor"]
    if len(holding) != 1 or tables:
        return ""
    plain = holding[0] == "torque_constant" and values["torque_constant"] == 1.0
    return "" if plain else holding[0]


def _scaled(model: Model) -> dict[str, str]:
    """By parameter that is a torque by something: where it acts, motor | arm | joint."""
    found = {n: "arm" if n.startswith("arm_") else "motor" for n in STRUCTURES[model.structure]}
    if "stiffness" in found:
        found["stiffness"] = "joint"
    for e in model.effects:
        for parameter in e.entry.parameters:
            if parameter.unit.startswith(_TORQUES):
                found[f"{e.location}.{e.effect}.{parameter.name}"] = model.place(e.location)
    return found
