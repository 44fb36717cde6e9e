"""Parameters that the recordings do not determine: why, what model.yaml has instead, and what to record."""

from __future__ import annotations

from haptic_teleop_sim.model import STRUCTURES, Model
from haptic_teleop_sysid.estimation.result import Estimate

_OF_STRUCTURE = {
    "inertia": "quicker motion, with higher frequencies in the signal",
    "damping": "motion at higher speed",
    "stiffness": "hung weights (`haptic-teleop stiffness`)",
    "torque_constant": "motion against a known load",
}
_BY_LAW = {
    "velocity": "motion at several speeds, slow reversals among them",
    "angle": "travel over more of the range",
    "deflection": "larger torques through the joint",
    "input": "larger and quicker inputs",
    "input rate": "larger and quicker inputs",
    "time": "a longer time",
}


def without_scale(model: Model) -> bool:
    """Whether nothing that is held gives torques a scale: with all of them free, and the torque constant,
    they grow and fall together."""
    free = model.free_parameters()
    if "torque_constant" not in free:
        return False
    units = {
        f"{e.location}.{e.effect}.{p.name}": p.unit for e in model.effects for p in e.entry.parameters
    }
    held = {n: v for n, v in model.parameter_values().items() if n not in free and v != 0.0}
    if any(e.table is not None for e in model.effects):
        return False
    return not any(n in STRUCTURES[model.structure] or _scales(units.get(n, "")) for n in held)


def _scales(unit: str) -> bool:
    """Whether what has this unit grows with all torques."""
    return "N*m" in unit or "kg*m^2" in unit


def what_determines(model: Model, name: str) -> str:
    """What to record so that a parameter shows, in words."""
    if name in STRUCTURES[model.structure]:
        return next(words for end, words in _OF_STRUCTURE.items() if name.endswith(end))
    head = name.rpartition(".")[0]
    entry = next(e.entry for e in model.effects if f"{e.location}.{e.effect}" == head)
    return entry.needs or _BY_LAW.get(entry.follows, "more and richer motion")


def undetermined_sentence(found: Estimate, name: str) -> str:
    """Why a parameter is not determined, and what model.yaml has in its place."""
    assert found.uncertainty is not None
    why, value = found.uncertainty.undetermined[name], found.model.parameter_values()[name]
    if name in found.kept:
        has = f"keeps the start value, {value:.6g}"
    elif name in found.uncertainty.combined:
        has = f"has {value:.6g}, which only means something beside the others"
    else:
        has = f"has {value:.6g}, with which the search ended, since the start value fits worse"
    return f"{name} cannot be determined from these recordings: {why}; model.yaml {has}."


def remedy(found: Estimate, name: str) -> str:
    """What makes up for an undetermined parameter, as a request."""
    if found.uncertainty is not None and name in found.uncertainty.combined:
        return f"hold {name}, or one that it changes together with, with --fix."
    return f"record {what_determines(found.model, name)}, or hold {name} with --fix."
