"""A model as a URDF file: one link behind one joint with `<dynamics>` and `<limit>`."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

from haptic_teleop_control.robots import OMNI_PEAK_TORQUE, SFJ_STAGES

from ..model import Model
from ..mujoco_xml import GRAVITY, number
from .target import Exported, Saying, comment, gain_before, limit_behind, replaced, xml_name
from .urdf_rules import FLEXIBILITY, near_rigid, urdf_saying

#: rad/s, and rad or N*m where nothing limits: URDF wants a number.
_NO_LIMIT = 1e4
#: Share of the inertia that comes from a mass off the axis, where gravity is to pull.
_OFF_AXIS = 0.3


def urdf_export(model: Model) -> Exported:
    """The model as URDF: links `<joint>_base` and `<joint>_link`, joint `<joint>`, rad, about y, CCW
    positive.

    A flexible joint becomes a rigid one, which ``structure`` says. Raises ModelError for a name that XML
    cannot hold.
    """
    sayings = tuple(urdf_saying(model, effect) for effect in model.effects)
    carried = replaced(model, sayings)
    if not model.rigid:
        carried = near_rigid(carried)
    root = _tree(carried)
    root.insert(0, ElementTree.Comment(comment(_header(model, sayings))))
    ElementTree.indent(root)
    text = '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
    if model.rigid:
        return Exported(text, sayings, carried)
    return Exported(text, sayings, carried, FLEXIBILITY, near_rigid(model))


def _header(model: Model, sayings: tuple[Saying, ...]) -> str:
    gain = gain_before(model, None)
    unit = "N*m/A of current" if model.robot == "sfj" else "per unit of the recorded effort"
    parts = [f"{model.robot} {model.joint}, {model.structure}; effort = {number(gain)} {unit}; SI units"]
    if not model.rigid:
        parts.append(FLEXIBILITY)
    parts += [f"{s.effect.effect} at {s.effect.location} {s.how}: {s.note}" for s in sayings if s.note]
    return "\n       ".join(parts)


def _tree(model: Model) -> ElementTree.Element:
    joint, p = xml_name(model), model.parameters
    flexible = not model.rigid
    inertia = p["motor_inertia"] + (p["arm_inertia"] if flexible else 0.0)
    damping = p["motor_damping"] + (p["arm_damping"] if flexible else 0.0)
    friction = sum(e.values["torque"] for e in model.effects if e.effect == "coulomb_friction")
    root = ElementTree.Element("robot", name=joint)
    ElementTree.SubElement(root, "link", name=f"{joint}_base")
    link = ElementTree.SubElement(root, "link", name=f"{joint}_link")
    _inertial(link, model, inertia)
    lower, upper = _range(model)
    kind = "continuous" if lower == -_NO_LIMIT and upper == _NO_LIMIT else "revolute"
    element = ElementTree.SubElement(root, "joint", name=joint, type=kind)
    ElementTree.SubElement(element, "parent", link=f"{joint}_base")
    ElementTree.SubElement(element, "child", link=f"{joint}_link")
    ElementTree.SubElement(element, "axis", xyz="0 1 0")
    limit = {"effort": number(_effort(model)), "velocity": number(_NO_LIMIT)}
    if kind == "revolute":
        limit = {"lower": number(lower), "upper": number(upper), **limit}
    ElementTree.SubElement(element, "limit", limit)
    ElementTree.SubElement(element, "dynamics", damping=number(damping), friction=number(friction))
    return root


def _inertial(link: ElementTree.Element, model: Model, inertia: float) -> None:
    """Mass and inertia: those of the body alone, so that about the joint they make the model's."""
    across, down, mass = 0.0, 0.0, 1.0
    for e in (e for e in model.effects if e.effect == "gravity"):
        across += e.values["torque"] * math.sin(e.values["phase"])
        down += e.values["torque"] * math.cos(e.values["phase"])
    torque = math.hypot(across, down)
    length = 0.0
    if torque > 0.0:
        length = _OFF_AXIS * inertia * GRAVITY / torque
        mass = torque / (GRAVITY * length)
    own = number(inertia - mass * length**2)
    element = ElementTree.SubElement(link, "inertial")
    place = (-length * across / torque, 0.0, -length * down / torque) if torque > 0.0 else (0.0, 0.0, 0.0)
    ElementTree.SubElement(element, "origin", xyz=" ".join(number(v) for v in place), rpy="0 0 0")
    ElementTree.SubElement(element, "mass", value=number(mass))
    ElementTree.SubElement(element, "inertia", ixx=own, iyy=own, izz=own, ixy="0", ixz="0", iyz="0")


def _range(model: Model) -> tuple[float, float]:
    """Angles that the stops allow, rad."""
    lower, upper = -_NO_LIMIT, _NO_LIMIT
    for e in (e for e in model.effects if e.effect == "hard_stop"):
        angle, both = e.values["angle"], e.values["both_sides"] > 0.5
        if angle > 0.0 or both:
            upper = min(upper, abs(angle))
        if angle <= 0.0 or both:
            lower = max(lower, -abs(angle))
    return lower, upper


def _effort(model: Model) -> float:
    """Largest effort of the joint, N*m: what the model limits, or what the robot gives at most."""
    for e in (e for e in model.effects if e.effect == "torque_saturation"):
        return limit_behind(model, e)
    if model.robot == "sfj":
        return SFJ_STAGES[model.joint].current_limit * gain_before(model, None)
    return OMNI_PEAK_TORQUE if model.robot == "omni" else _NO_LIMIT
