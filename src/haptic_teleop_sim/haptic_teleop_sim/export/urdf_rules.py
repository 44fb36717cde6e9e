"""What a URDF says of a model: a rigid link behind one joint with damping, dry friction and limits."""

from __future__ import annotations

from dataclasses import replace

from ..model import Effect, Model
from .target import DRY, Saying, dry_friction, left_out, said

#: How many times as stiff a joint counts as rigid in what stands for it here.
RIGID_STIFFNESS = 1000.0
#: How many times as stiff as the model's a stop is that gives way to nothing.
_HARD = 100.0
_JOINT_RATIO = 1.0
FLEXIBILITY = (
    "URDF has no spring between two moving links: motor and arm are one link, with the sum of their "
    "inertias, dampings and frictions"
)


def near_rigid(model: Model) -> Model:
    """The flexible joint with a spring so stiff, and damped, that motor and arm move together."""
    p = dict(model.parameters)
    p["stiffness"] *= RIGID_STIFFNESS
    both = p["motor_inertia"] * p["arm_inertia"] / (p["motor_inertia"] + p["arm_inertia"])
    damping = 2.0 * _JOINT_RATIO * (p["stiffness"] * both) ** 0.5
    damper = Effect("joint_damping", model.location("joint"), {"coefficient": damping})
    kept = [e for e in model.effects if model.place(e.location) != "joint"]
    return replace(model, parameters=p, effects=(*kept, damper), fixed=())


def urdf_saying(model: Model, effect: Effect) -> Saying:
    """How a URDF says one effect of the model."""
    name, place = effect.effect, model.place(effect.location)
    if name in DRY:
        return dry_friction_alone(effect)
    if name == "gravity":
        return said(effect, "as the place of the link's centre of mass")
    if name == "gain_error":
        return said(effect, "in the comment that says the joint's effort per input")
    if name == "torque_saturation":
        return said(effect, "as the limit of the joint's effort")
    if name == "hard_stop":
        values = {**effect.parameters, "stiffness": _HARD * effect.values["stiffness"]}
        stop = replace(effect, parameters=values)
        return Saying(effect, "approximated", (stop,), "as a limit, which gives way as the engine decides")
    if place == "joint":
        return left_out(effect, "the joint is rigid there")
    if name == "channel_skew":
        return left_out(effect, "it tells how a recording was stamped, not how the robot moves")
    return left_out(effect, "URDF has no words for it")


def dry_friction_alone(effect: Effect) -> Saying:
    """As `dry_friction`, without a constant torque, for which URDF has no words."""
    found = dry_friction(effect)
    if len(found.instead) < 2:
        return found
    return replace(found, instead=found.instead[:1], note="as its mean over the two directions")
