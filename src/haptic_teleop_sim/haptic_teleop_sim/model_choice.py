"""From a parameter such as `stage1.model` to a checked model of that joint."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from haptic_teleop_control.errors import ConfigurationError, ModelError
from haptic_teleop_control.named_files import similar

from .model import Effect, Model, load_model, read_model


def choose_model(
    joint: str,
    path: str,
    built_in: Callable[[str], Model],
    folder: str | Path | None,
    source: str,
    models: Mapping[str, str] | None = None,
) -> Model:
    """The model of `joint`: the text that `models` (path -> text of a model file) holds of `path`, else from
    the file `path`, looked for beside the parameter file (`folder`), then from the working directory; the
    built-in one when `path` is empty.

    Raises ConfigurationError when there is no such file, ModelError when it is no model of this joint.
    """
    if not path:
        return built_in(joint)
    if models and path in models:
        return check_joint(read_model(models[path], path), joint)
    candidates = [Path(folder) / path] if folder is not None else []
    candidates.append(Path(path))
    for candidate in candidates:
        if candidate.is_file():
            return check_joint(load_model(candidate), joint)
    tried = dict.fromkeys(str(candidate) for candidate in candidates)
    where = "" if list(tried) == [path] else f" (looked for {', '.join(tried)})"
    near = next((found for candidate in candidates if (found := similar(candidate))), None)
    remedy = f"did you mean {near}?" if near else "correct the path, or leave it empty for the built-in one."
    raise ConfigurationError(
        f"{source}: parameter {joint}.model is {path!r}, but there is no such file{where}; {remedy}"
    )


def check_joint(model: Model, joint: str) -> Model:
    """`model`; ModelError when it is one of another joint, or when it has what no running robot can have: a
    reading from the future, or a current that is recorded at another time than it is measured."""
    if model.joint != joint:
        raise ModelError(
            f"{model.source}: this is a model of {model.joint}, where one of {joint} is needed; "
            f"give that one, or leave {joint}.model empty for the built-in model."
        )
    for effect in model.effects:
        early = effect.entry.kind == "skew" and any(value < 0.0 for value in effect.values.values())
        if early or (effect.entry.kind == "skew" and effect.location == model.location("actuator")):
            raise ModelError(
                f"{model.source}: {effect.effect} at {effect.location} is an error of a recording's stamps, "
                "and a running robot has none: take it out of the model that a plant simulates; "
                "`compare` takes the model as it is."
            )
    return model


def add_effect(model: Model, effect: Effect, reason: str) -> Model:
    """`model` with one more effect; ModelError that names `reason` (a parameter) when it has that one
    already.
    """
    for present in model.effects:
        if (present.effect, present.location) == (effect.effect, effect.location):
            raise ModelError(
                f"{model.source}: the model has {effect.effect} at {effect.location} already, "
                f"and {reason} asks for another; take one of the two away."
            )
    return model.with_effects(effect)
