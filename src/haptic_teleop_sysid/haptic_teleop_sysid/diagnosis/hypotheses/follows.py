"""What an effect's torque follows from: the motion, or the input of the actuator."""

from __future__ import annotations

from haptic_teleop_sim.effects import EffectEntry


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
