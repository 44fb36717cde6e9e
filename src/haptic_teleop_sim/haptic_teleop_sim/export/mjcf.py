"""A model as an MJCF file: hinges with absolute angles, a tendon as the spring between them, an actuator
that takes the model's input, and sensors that read as its encoders do."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

from ..model import Effect, Model
from ..mujoco_effects import StageWords, plain_words, say
from ..mujoco_xml import GRAVITY, Attributes, inertial, number
from .mjcf_rules import mjcf_saying
from .target import Exported, Saying, comment, gain_before, input_words, limit_behind, replaced, xml_name

#: Share of a motor's inertia that its body keeps, the rest being armature: no body may have none.
_BODY_SHARE = 1e-6
_ELSEWHERE = (
    "gain_error",
    "joint_preload",
    "encoder_scale",
    "sensor_delay",
    "hysteresis",
    "torque_saturation",
)


def mjcf_export(model: Model, timestep: float) -> Exported:
    """The model as MJCF; timestep, s, above zero.

    Names: hinges `<joint>_motor` and `<joint>_arm`, rad, absolute, CCW positive; actuator `<joint>_drive`,
    whose control is the model's input; sensors `<hinge>.position` and `<hinge>.velocity`. Raises ModelError
    for a name that XML cannot hold.
    """
    sayings = tuple(mjcf_saying(model, effect) for effect in model.effects)
    carried = replaced(model, sayings)
    words = plain_words(carried)
    for effect in carried.effects:
        if effect.effect not in _ELSEWHERE:
            say(words, effect)
    root = _tree(carried, words, timestep)
    root.insert(0, ElementTree.Comment(comment(_header(model, sayings))))
    ElementTree.indent(root)
    return Exported(ElementTree.tostring(root, encoding="unicode") + "\n", sayings, carried)


def _header(model: Model, sayings: tuple[Saying, ...]) -> str:
    parts = [
        f"{model.robot} {model.joint}, {model.structure}; control: {input_words(model)}; SI units, angles "
        "absolute, masses nominal where gravity does not pull"
    ]
    parts += [f"{s.effect.effect} at {s.effect.location} {s.how}: {s.note}" for s in sayings if s.note]
    return "\n       ".join(parts)


def _tree(model: Model, words: StageWords, timestep: float) -> ElementTree.Element:
    joint, p = xml_name(model), model.parameters
    root = ElementTree.Element("mujoco", model=joint)
    _add(root, "compiler", {"angle": "radian", "autolimits": "true"})
    option = _add(
        root,
        "option",
        {"timestep": number(timestep), "integrator": "implicitfast", "gravity": f"0 0 -{GRAVITY}"},
    )
    _add(option, "flag", {"autoreset": "disable"})
    softness = {"solreffriction": "0.001 1", "solimpfriction": "0.99 0.999 0.001"}
    _add(_add(root, "default", {}), "joint", softness)
    world = _add(root, "worldbody", {})
    motor = {"name": f"{joint}_motor", "axis": "0 1 0", **words.motor}
    inertia = p["motor_inertia"]
    if not model.rigid and words.motor_mass is None:
        motor["armature"] = number((1.0 - _BODY_SHARE) * inertia)
        inertia *= _BODY_SHARE
    _body(world, motor, inertial(inertia, *(words.motor_mass or (1.0, 0.0, 0.0))))
    places = ["motor"]
    if not model.rigid:
        arm = {"name": f"{joint}_arm", "axis": "0 1 0", **words.arm}
        body = _body(world, arm, inertial(p["arm_inertia"], *words.mass))
        if words.mode:
            body.append(ElementTree.fromstring(words.mode))
        _spring(root, model, words, joint)
        places.append("arm")
    _actuators(root, model, words, timestep)
    _sensors(root, model, places, timestep)
    return root


def _add(parent: ElementTree.Element, name: str, attributes: Attributes) -> ElementTree.Element:
    return ElementTree.SubElement(parent, name, attributes)


def _body(world: ElementTree.Element, hinge: Attributes, mass: str) -> ElementTree.Element:
    body = _add(world, "body", {"name": hinge["name"]})
    _add(body, "joint", hinge)
    body.append(ElementTree.fromstring(mass))
    return body


def _spring(root: ElementTree.Element, model: Model, words: StageWords, joint: str) -> None:
    attributes = {"name": f"{joint}_joint", **words.spring}
    if loss := _found(model, "hysteresis", "joint"):
        attributes |= {"frictionloss": number(loss.values["torque"]), "solreffriction": "0.001 1"}
        attributes["solimpfriction"] = "0.99 0.999 0.001"
    tendon = _add(_tendons(root), "fixed", attributes)
    _add(tendon, "joint", {"joint": f"{joint}_motor", "coef": "1"})
    _add(tendon, "joint", {"joint": f"{joint}_arm", "coef": "-1"})


def _tendons(root: ElementTree.Element) -> ElementTree.Element:
    found = root.find("tendon")
    return _add(root, "tendon", {}) if found is None else found


def _actuators(root: ElementTree.Element, model: Model, words: StageWords, timestep: float) -> None:
    joint = model.joint
    actuator = _add(root, "actuator", {})
    gain = gain_before(model, None)
    drive = {"name": f"{joint}_drive", "joint": f"{joint}_motor", "gainprm": number(gain), **words.actuator}
    order = [e.effect for e in model.effects if e.effect in ("torque_saturation", "actuator_lag")]
    limit = _found(model, "torque_saturation", "actuator")
    if limit is not None:
        # What is limited before a lag is its input, what behind it the force.
        what, scale = ("ctrl", gain) if order == ["torque_saturation", "actuator_lag"] else ("force", 1.0)
        bound = number(limit_behind(model, limit) / scale)
        drive |= {f"{what}limited": "true", f"{what}range": f"-{bound} {bound}"}
    if words.delay > 0.0:
        drive |= {"delay": number(words.delay), "nsample": _samples(words.delay, timestep), "interp": "zoh"}
    _add(actuator, "general", drive)
    constant = dict(zip(("motor", "arm"), words.torque, strict=True))
    if preload := _found(model, "joint_preload", "joint"):
        constant["motor"] -= preload.values["torque"]
        constant["arm"] += preload.values["torque"]
    for place, torque in constant.items():
        if torque:
            bias = {"gainprm": "0", "biastype": "affine", "biasprm": f"{number(torque)} 0 0"}
            _add(
                actuator,
                "general",
                {"name": f"{joint}_{place}_constant", "joint": f"{joint}_{place}", **bias},
            )


def _sensors(root: ElementTree.Element, model: Model, places: list[str], timestep: float) -> None:
    sensors = _add(root, "sensor", {})
    for place in places:
        hinge = f"{model.joint}_{place}"
        source, kind = {"joint": hinge}, "joint"
        if scale := _found(model, "encoder_scale", f"{place}_encoder"):
            tendon = _add(_tendons(root), "fixed", {"name": f"{hinge}_encoder"})
            _add(tendon, "joint", {"joint": hinge, "coef": number(scale.values["scale"])})
            source, kind = {"tendon": f"{hinge}_encoder"}, "tendon"
        late: Attributes = {}
        if (delay := _found(model, "sensor_delay", f"{place}_encoder")) and delay.values["delay"] > 0.0:
            age = delay.values["delay"]
            late = {"delay": number(age), "nsample": _samples(age, timestep), "interp": "linear"}
        for signal, short in (("position", "pos"), ("velocity", "vel")):
            _add(sensors, kind + short, {"name": f"{hinge}.{signal}", **source, **late})


def _samples(delay: float, timestep: float) -> str:
    """Length of the engine's history for a delay."""
    return str(math.ceil(delay / timestep) + 2)


def _found(model: Model, name: str, place: str) -> Effect | None:
    location = model.location(place)
    return next((e for e in model.effects if (e.effect, e.location) == (name, location)), None)
