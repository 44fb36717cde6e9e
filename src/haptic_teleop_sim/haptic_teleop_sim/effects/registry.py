"""All effects, by name.  A new effect is one new entry in one of the files beside this one."""

from __future__ import annotations

import difflib

from haptic_teleop_control.errors import ModelError

from . import actuator, friction, joint, position, sensor, torque_map, unnamed
from .entry import EffectEntry

EFFECTS: dict[str, EffectEntry] = {
    entry.name: entry
    for module in (friction, position, joint, actuator, sensor, torque_map, unnamed)
    for entry in module.ENTRIES
}

MEASURED: EffectEntry = next(entry for entry in EFFECTS.values() if entry.tabulated)
"""The effect that is a measured torque in place of a name; result files call it so, too."""


def effect_entry(name: str, source: str = "the model") -> EffectEntry:
    """The entry of that name; ModelError that names the nearest one when there is none."""
    if name not in EFFECTS:
        near = difflib.get_close_matches(str(name), EFFECTS, n=1)
        hint = f"did you mean {near[0]}?" if near else f"known effects: {', '.join(EFFECTS)}"
        raise ModelError(f"{source}: there is no effect {name!r}; {hint}")
    return EFFECTS[name]


def locations(name: str, structure: str) -> tuple[str, ...]:
    """Where the effect may sit in a structure: places such as ``motor`` (a rigid body has only the
    motor, its actuator and its encoder)."""
    entry = effect_entry(name)
    if structure == "rigid_body":
        if not entry.rigid_body:
            return ()
        return tuple(w for w in entry.where if w in ("motor", "actuator", "motor_encoder"))
    return tuple(w for w in entry.where if w != "motor") if entry.motor_of_rigid_body else entry.where
