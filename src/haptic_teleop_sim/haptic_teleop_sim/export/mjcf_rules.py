"""Which effects an MJCF file says, and what it says in place of the others."""

from __future__ import annotations

from dataclasses import replace

from ..model import Effect, Model
from ..mujoco_effects import has_words
from .target import DRY, STICKING, Saying, dry_friction, left_out, said

#: rad: deflection over which the dry friction of a tendon turns round in what stands for it here.
_SLIPS = 1e-4
_NOT_IN_A_FILE = {
    "dead_zone": "the engine's actuators have no dead zone: put it into what sets the control",
    "payload_change": "a file has no time: add the inertia to the arm's when the load comes",
}
_NO_WORDS = "MJCF has no words for it"
_STAMPS = "it tells how a recording was stamped, not how the robot moves"


def mjcf_saying(model: Model, effect: Effect) -> Saying:
    """How an MJCF file says one effect of the model."""
    name, place = effect.effect, model.place(effect.location)
    if name in DRY:
        return dry_friction(effect)
    if name in _NOT_IN_A_FILE:
        return left_out(effect, _NOT_IN_A_FILE[name])
    if name == "hysteresis":
        small = min(effect.values["displacement"], _SLIPS)
        loss = replace(effect, parameters={**effect.parameters, "displacement": small})
        how = "expressed" if effect.values["displacement"] <= STICKING else "approximated"
        return Saying(effect, how, (loss,), "as the tendon's dry friction, which builds up at once")
    if name == "hard_stop" and effect.values["dissipation"] > 0.0:
        note = "its damping is linear there, while the model's grows with penetration: see the engine's fit"
        return Saying(effect, "approximated", (effect,), note)
    if name == "channel_skew":
        return left_out(effect, _STAMPS)
    known = ("gain_error", "joint_preload", "encoder_scale", "sensor_delay", "gravity")
    if name in known or has_words(name, place):
        return said(effect)
    return left_out(effect, _NO_WORDS)
