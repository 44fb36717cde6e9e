"""A model whose motor a controller holds in place."""

from __future__ import annotations

from dataclasses import replace

from .model import Effect, Model

_SPRING = "spring_to_ground"


def in_position_loop(model: Model, stiffness: float) -> Model:
    """The model under a proportional position loop of ``stiffness`` (N·m/rad) about angle zero: to the motor,
    a spring to the place where it began, together with one that is there already."""
    place, effects = model.location("motor"), []
    rest = 0.0
    for e in model.effects:
        if (e.effect, e.location) == (_SPRING, place):
            rest, stiffness = e.values["stiffness"] * e.values["rest"], stiffness + e.values["stiffness"]
        else:
            effects.append(e)
    spring = Effect(_SPRING, place, {"stiffness": stiffness, "rest": rest / stiffness})
    return replace(model, effects=(*effects, spring))
