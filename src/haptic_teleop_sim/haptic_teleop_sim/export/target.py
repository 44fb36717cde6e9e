"""What a target says of a model: each effect as it is, by something like it, or not at all."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from haptic_teleop_control.errors import ModelError

from ..effects.parameter import STICTION_ANGLE
from ..model import Effect, Model

How = Literal["expressed", "approximated", "left out"]
#: rad of contact angle up to which dry friction counts as one that sticks.
STICKING = 25.0 * STICTION_ANGLE


@dataclass(frozen=True)
class Saying:
    """How a target says one effect: ``instead`` simulates here what the file does in its place (empty:
    nothing), ``note`` is a sentence for the user, "" where there is nothing to add."""

    effect: Effect
    how: How
    instead: tuple[Effect, ...]
    note: str = ""


@dataclass(frozen=True)
class Exported:
    """A file's ``text`` and what it says.

    ``carried``: the model as the file has it, to be simulated here. ``structure``: what became of the
    structure, "" where it is said as it is; then ``rigid`` is the model with that change alone.
    """

    text: str
    sayings: tuple[Saying, ...]
    carried: Model
    structure: str = ""
    rigid: Model | None = None


def said(effect: Effect, note: str = "") -> Saying:
    """The effect is in the file as it is."""
    return Saying(effect, "expressed", (effect,), note)


def left_out(effect: Effect, why: str) -> Saying:
    """The file has nothing for the effect."""
    return Saying(effect, "left out", (), why)


def dry_friction(effect: Effect) -> Saying:
    """Any dry friction as the constant torque that simulators know, and what remains of its asymmetry."""
    v = effect.values
    if effect.effect == "coulomb_friction":
        if v["smoothing"] <= 0.0 and v["contact_angle"] <= STICKING:
            return said(effect)
        return _like(effect, v["torque"], "as friction that sticks, without its smooth or elastic beginning")
    if effect.effect == "stribeck_friction":
        return _like(effect, v["coulomb"], "as the friction at speed, without what it is more at the start")
    if effect.effect == "asymmetric_friction":
        mean, half = 0.5 * (v["positive"] + v["negative"]), 0.5 * (v["positive"] - v["negative"])
        return _like(
            effect, mean, "as its mean and a constant torque, which also pulls at rest", constant=-half
        )
    if effect.effect == "presliding_friction":
        return _like(effect, v["torque"], "as friction that slides at once, without its elastic beginning")
    return _like(effect, v["torque"], "as its mean over the angle")


DRY = ("coulomb_friction", "stribeck_friction", "asymmetric_friction", "presliding_friction",
       "position_dependent_friction")  # fmt: skip


def _like(effect: Effect, torque: float, note: str, constant: float = 0.0) -> Saying:
    instead = [Effect("coulomb_friction", effect.location, {"torque": torque})]
    if constant:
        instead.append(Effect("constant_torque", effect.location, {"torque": constant}))
    return Saying(effect, "approximated", tuple(instead), note)


def replaced(model: Model, sayings: Iterable[Saying]) -> Model:
    """The model with each effect in ``sayings`` replaced by what stands in its place; torques of the same
    kind at one place are added, since a model may have each effect there once."""
    instead = {(s.effect.effect, s.effect.location): s.instead for s in sayings}
    effects: dict[tuple[str, str], Effect] = {}
    for old in model.effects:
        for new in instead.get((old.effect, old.location), (old,)):
            key = (new.effect, new.location)
            if key in effects:
                total = effects[key].values["torque"] + new.values["torque"]
                new = replace(new, parameters={**effects[key].parameters, "torque": total})
            effects[key] = new
    return replace(model, effects=tuple(effects.values()), fixed=())


def gain_before(model: Model, effect: Effect | None) -> float:
    """Torque per input, N·m/A or 1, ahead of an input effect; of all gains together for None."""
    gain = model.parameters["torque_constant"]
    for other in model.effects:
        if effect is not None and (other.effect, other.location) == (effect.effect, effect.location):
            break
        if other.effect == "gain_error":
            gain *= other.values["gain"]
    return gain


def input_words(model: Model) -> str:
    """The model's input and its unit. The file of a model of another robot does not say in which unit its
    input was recorded."""
    known = {"sfj": "current, A", "omni": "torque, N*m"}
    return known.get(model.robot, "input, in the unit of the recording")


def limit_behind(model: Model, effect: Effect) -> float:
    """What a saturation lets through, N·m, behind the gains that follow it in the model."""
    after = gain_before(model, None) / gain_before(model, effect)
    return effect.values["limit"] * after


def xml_name(model: Model) -> str:
    """The joint's name for an XML attribute. ModelError for one that no XML file can hold."""
    if not model.joint.isprintable() or not model.joint.strip():
        raise ModelError(
            f"{model.source}: joint {model.joint!r} cannot be a name in XML; give it printable letters."
        )
    return model.joint


def comment(text: str) -> str:
    """A text that may stand in an XML comment."""
    return " " + re.sub("-(?=-)", "- ", text) + " "
