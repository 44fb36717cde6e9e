"""A model: a structure, its parameters and a list of effects; the model file that every tool reads and
writes.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from haptic_teleop_control.errors import ModelError
from haptic_teleop_control.named_files import why_unreadable
from haptic_teleop_control.strict_yaml import dump_yaml, parse_yaml, yaml_problem

from .effects import EFFECTS, EffectEntry, effect_entry, locations
from .effects.torque_map import TorqueMap
from .effects.torque_map_file import torque_map

STRUCTURES: dict[str, tuple[str, ...]] = {
    "flexible_joint": (
        "torque_constant",
        "stiffness",
        "motor_inertia",
        "motor_damping",
        "arm_inertia",
        "arm_damping",
    ),
    "rigid_body": ("torque_constant", "motor_inertia", "motor_damping"),
}
#: Units for a rotary joint; the torque constant of a generic or Omni model is a plain gain.
PARAMETER_UNITS = {
    "torque_constant": "N*m/A",
    "stiffness": "N*m/rad",
    "motor_inertia": "kg*m^2",
    "motor_damping": "N*m*s/rad",
    "arm_inertia": "kg*m^2",
    "arm_damping": "N*m*s/rad",
}
JOINTS = {"sfj": ("stage1", "stage2"), "omni": ("omni_x", "omni_y", "omni_z")}
_POSITIVE = ("torque_constant", "stiffness", "motor_inertia", "arm_inertia")
_KEYS = ("haptic_teleop_model", "robot", "joint", "structure", "parameters", "fixed", "effects", "io")


@dataclass(frozen=True)
class Effect:
    """One effect at one place, e.g. ``Effect("coulomb_friction", "stage1_motor", {"torque": 0.4})``.

    Optional parameters that are left out keep their default and are not estimated. ``table``: the numbers of
    an effect that is a map, which are never estimated.
    """

    effect: str
    location: str
    parameters: Mapping[str, float] = field(default_factory=dict)
    table: TorqueMap | None = None

    @property
    def entry(self) -> EffectEntry:
        return effect_entry(self.effect)

    @property
    def values(self) -> dict[str, float]:
        """All parameters in the entry's order, defaults filled in."""
        return {
            p.name: float(self.parameters.get(p.name, p.default if p.default is not None else math.nan))
            for p in self.entry.parameters
        }


@dataclass(frozen=True)
class Model:
    """What the model file says.  ``parameters`` in SI units; ``fixed`` names what is not estimated: names of
    the structure's parameters, or ``<location>.<effect>.<parameter>``.
    """

    robot: str
    joint: str
    structure: str
    parameters: Mapping[str, float]
    fixed: tuple[str, ...] = ()
    effects: tuple[Effect, ...] = ()
    io: Mapping[str, Any] | None = None
    source: str = "the model"

    def __post_init__(self) -> None:
        _check(self)

    @property
    def rigid(self) -> bool:
        return self.structure == "rigid_body"

    def location(self, place: str) -> str:
        """Full name of a place, e.g. ``stage1_motor``."""
        return f"{self.joint}_{place}"

    def place(self, location: str) -> str:
        """The place in a location, e.g. ``motor``."""
        return location.removeprefix(f"{self.joint}_")

    def parameter_values(self) -> dict[str, float]:
        """Every number of the model by its full name, structure first."""
        values = {n: float(self.parameters[n]) for n in STRUCTURES[self.structure]}
        for e in self.effects:
            values.update({f"{e.location}.{e.effect}.{n}": v for n, v in e.values.items()})
        return values

    def free_parameters(self) -> tuple[str, ...]:
        """Names of what is estimated: not fixed, and for optional parameters written out."""
        free = [n for n in STRUCTURES[self.structure] if n not in self.fixed]
        for e in self.effects:
            for p in e.entry.parameters:
                name = f"{e.location}.{e.effect}.{p.name}"
                if name not in self.fixed and p.name in e.parameters:
                    free.append(name)
        return tuple(free)

    def with_values(self, values: Mapping[str, float]) -> Model:
        """A copy with some numbers replaced, by their full names; KeyError for a name it does not have."""
        base = dict(self.parameters)
        effects = [dict(e.parameters) for e in self.effects]
        places = {f"{e.location}.{e.effect}": i for i, e in enumerate(self.effects)}
        for name, value in values.items():
            if name in base:
                base[name] = float(value)
            else:
                head, _, tail = name.rpartition(".")
                effects[places[head]][tail] = float(value)
        return replace(
            self,
            parameters=base,
            effects=tuple(replace(e, parameters=p) for e, p in zip(self.effects, effects, strict=True)),
        )

    def with_effects(self, *effects: Effect) -> Model:
        """A copy with further effects."""
        return replace(self, effects=(*self.effects, *effects))

    def without(self, effect: str, location: str) -> Model:
        """A copy without one of its effects, and without that one's parameters among the fixed ones."""
        head = f"{location}.{effect}."
        return replace(
            self,
            effects=tuple(e for e in self.effects if (e.effect, e.location) != (effect, location)),
            fixed=tuple(name for name in self.fixed if not name.startswith(head)),
        )

    def to_mapping(self) -> dict[str, Any]:
        """The model file's content."""
        content: dict[str, Any] = {
            "haptic_teleop_model": 1,
            "robot": self.robot,
            "joint": self.joint,
            "structure": self.structure,
            "parameters": {n: float(v) for n, v in self.parameters.items()},
            "fixed": list(self.fixed),
            "effects": [
                {
                    "effect": e.effect,
                    "location": e.location,
                    "parameters": {n: float(v) for n, v in e.parameters.items()}
                    | ({} if e.table is None else e.table.to_mapping()),
                }
                for e in self.effects
            ],
        }
        if self.io is not None:
            content["io"] = dict(self.io)
        return content

    def save(self, path: str | Path, comments: Sequence[str] = ()) -> None:
        """Write the model file, with lines of comment above it."""
        above = "".join(f"# {' '.join(line.split())}\n" for line in comments)
        text = dump_yaml(self.to_mapping(), default_flow_style=None)
        Path(path).write_text(above + text, encoding="utf-8")


def parameter_bounds(model: Model, name: str) -> tuple[float, float]:
    """Lowest and highest allowed value of a parameter, by its full name; KeyError if the model has none such.
    """
    if name in STRUCTURES[model.structure]:
        return (1e-12 if name in _POSITIVE else 0.0), math.inf
    head, _, tail = name.rpartition(".")
    for e in model.effects:
        if f"{e.location}.{e.effect}" == head:
            parameter = e.entry.parameter(tail)
            return parameter.minimum, parameter.maximum
    raise KeyError(name)


MODEL_FILE = "model.yaml"
"""What a model file is called that a command writes into a folder of results."""


def load_model(path: str | Path) -> Model:
    """Read a model file; ModelError names the file, the key and the remedy."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = why_unreadable(path, error, MODEL_FILE)
        raise ModelError(f"{path}: the model file cannot be read: {why}") from None
    return read_model(text, str(path))


def read_model(text: str, source: str) -> Model:
    """A model from the text of a model file; ModelError names ``source``, the key and the remedy."""
    try:
        content = parse_yaml(text)
    except yaml.YAMLError as error:
        raise ModelError(f"{source}: {yaml_problem(error)}") from None
    return model_from_mapping(content, source)


def model_from_mapping(content: object, source: str = "the model") -> Model:
    """A model from the content of a model file; errors name ``source``."""
    if not isinstance(content, Mapping) or content.get("haptic_teleop_model") != 1:
        raise ModelError(f"{source}: not a model file; it must begin with 'haptic_teleop_model: 1'")
    _known(content, _KEYS, source, "key")
    for key in ("robot", "joint", "structure", "parameters"):
        if key not in content:
            raise ModelError(f"{source}: the key {key!r} is missing; add it")
    effects = content.get("effects") or []
    fixed = content.get("fixed") or []
    if not isinstance(effects, list) or not isinstance(fixed, list):
        raise ModelError(f"{source}: 'effects' and 'fixed' must be lists")
    if not isinstance(content["parameters"], Mapping):
        raise ModelError(f"{source}: 'parameters' must map names to numbers")
    joint = "" if content["joint"] is None else str(content["joint"])
    inside = all(part.strip() not in ("", ".", "..") for part in joint.split("/"))
    if not inside or "\\" in joint or not joint.isprintable():
        raise ModelError(
            f"{source}: joint is {joint!r}; give the joint's name: results lie in a directory of that name"
        )
    return Model(
        robot=str(content["robot"]),
        joint=joint,
        structure=str(content["structure"]),
        parameters=dict(content["parameters"]),
        fixed=tuple(str(f) for f in fixed),
        effects=tuple(_effect(e, source) for e in effects),
        io=content.get("io"),
        source=source,
    )


def _effect(content: object, source: str) -> Effect:
    if not isinstance(content, Mapping) or "effect" not in content or "location" not in content:
        raise ModelError(f"{source}: every entry of 'effects' needs the keys effect, location and parameters")
    _known(content, ("effect", "location", "parameters"), source, f"key of effect {content['effect']}:")
    parameters = content.get("parameters") or {}
    if not isinstance(parameters, Mapping):
        raise ModelError(f"{source}: 'parameters' of effect {content['effect']} must map names to numbers")
    name, location = str(content["effect"]), str(content["location"])
    if name in EFFECTS and EFFECTS[name].tabulated:
        return Effect(name, location, table=torque_map(parameters, source))
    return Effect(name, location, dict(parameters))


def _known(content: Mapping[Any, Any], known: tuple[str, ...], source: str, what: str) -> None:
    for key in content:
        if key not in known:
            near = difflib.get_close_matches(str(key), known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}"
            raise ModelError(f"{source}: unknown {what} {key!r}; {hint}")


def _number(value: object, name: str, source: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ModelError(f"{source}: {name} is {value!r}; give a finite number")
    return float(value)


def _check(model: Model) -> None:
    source = model.source
    if model.robot not in ("sfj", "omni", "generic"):
        raise ModelError(f"{source}: robot is {model.robot!r}; give sfj, omni or generic")
    if model.robot in JOINTS and model.joint not in JOINTS[model.robot]:
        raise ModelError(
            f"{source}: joint is {model.joint!r}; robot {model.robot} has {', '.join(JOINTS[model.robot])}"
        )
    if model.structure not in STRUCTURES:
        raise ModelError(f"{source}: structure is {model.structure!r}; give {' or '.join(STRUCTURES)}")
    names = STRUCTURES[model.structure]
    _known(model.parameters, names, source, f"parameter of {model.structure}:")
    for name in names:
        if name not in model.parameters:
            raise ModelError(
                f"{source}: parameter {name!r} is missing; {model.structure} needs {', '.join(names)}"
            )
        value = _number(model.parameters[name], f"parameter {name}", source)
        if name in _POSITIVE and value <= 0.0:
            raise ModelError(f"{source}: parameter {name} is {value}; it must be greater than zero")
    seen: set[tuple[str, str]] = set()
    for effect in model.effects:
        _check_effect(model, effect)
        if (effect.effect, effect.location) in seen:
            raise ModelError(f"{source}: {effect.effect} at {effect.location} stands there twice; keep one")
        seen.add((effect.effect, effect.location))
    signals = sorted(other_signals(model))
    if signals and (model.robot == "generic" or model.joint not in ("stage1", "stage2")):
        asked = (e for e in model.effects if e.entry.exogenous or _of_the_other(e))
        follows = next(f"{e.effect} at {e.location}" for e in asked)
        raise ModelError(
            f"{source}: {follows} follows another joint, which only the stages of the 2DSFJ have; give "
            "a quantity of this joint"
        )
    if len(signals) > 1:
        raise ModelError(
            f"{source}: its effects ask for {' and '.join(signals)}; a joint can follow one signal of another"
        )
    known = tuple(model.parameter_values())
    for name in model.fixed:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            raise ModelError(
                f"{source}: 'fixed' names {name!r}, which the model does not have; "
                + (f"did you mean {near[0]!r}?" if near else f"it has {', '.join(known)}")
            )


def other_signals(model: Model) -> set[str]:
    """What the model's effects ask of the robot's other joint: ``other_arm_acceleration``, ``other_angle``,
    ``other_velocity``."""
    found = {e.entry.exogenous for e in model.effects}
    return found.union(*map(_of_the_other, model.effects)) - {""}


def _of_the_other(effect: Effect) -> set[str]:
    """The variables of a map that are another joint's."""
    return (
        {v for v in effect.table.variables if v.startswith("other_")} if effect.table is not None else set()
    )


def _check_table(model: Model, effect: Effect) -> None:
    table, source = effect.table, model.source
    if table is None:
        raise ModelError(
            f"{source}: {effect.effect} at {effect.location} has no variable, knots and torque; add them"
        )
    bent = [v for v in table.variables if v.startswith("deflection")]
    if model.rigid and bent:
        raise ModelError(f"{source}: {effect.effect} depends on {bent[0]}, which a rigid_body does not have")


def _check_effect(model: Model, effect: Effect) -> None:
    source = model.source
    entry = effect_entry(effect.effect, source)
    # gravity and payload_change at the motor of a flexible joint are physical, if unusual: allow them to
    # simulate.
    places = tuple(p for p in entry.where) if not model.rigid else locations(effect.effect, model.structure)
    allowed = [model.location(place) for place in places]
    if effect.location not in allowed:
        raise ModelError(
            f"{source}: {effect.effect} cannot sit at {effect.location!r}; "
            + (f"possible: {', '.join(allowed)}" if allowed else f"a {model.structure} has no place for it")
        )
    _known(effect.parameters, entry.parameter_names, source, f"parameter of {effect.effect}:")
    if entry.tabulated:
        _check_table(model, effect)
    for parameter in entry.parameters:
        name = f"{effect.effect}.{parameter.name}"
        if parameter.name not in effect.parameters:
            if parameter.default is None:
                raise ModelError(
                    f"{source}: {name} is missing; add it ({parameter.meaning}, {parameter.unit})"
                )
            continue
        value = _number(effect.parameters[parameter.name], name, source)
        if not parameter.minimum <= value <= parameter.maximum:
            raise ModelError(
                f"{source}: {name} is {value}; it must lie between {parameter.minimum} and "
                f"{parameter.maximum} {parameter.unit}"
            )
