"""Effects that are one and the same thing to any recording of these channels.

A reading that is late and a reading that is stamped late cannot be told apart, nor a torque that is late from
a command that is stamped early.  The search may come upon one of the two only; both are put up for choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.gauss_newton import Fit

from .explanation import Explanation


def twin(effect: Effect) -> Effect | None:
    """The other name of the same thing, or None."""
    delay = effect.parameters.get("delay", 0.0)
    if delay == 0.0:
        return None
    sign = -1.0 if effect.location.endswith("_actuator") else 1.0
    if effect.effect in ("sensor_delay", "input_delay"):
        return Effect("channel_skew", effect.location, {"delay": sign * delay})
    if effect.effect == "channel_skew" and sign * delay > 0.0:
        name = "input_delay" if sign < 0.0 else "sensor_delay"
        return Effect(name, effect.location, {"delay": sign * delay})
    return None


def with_twins(found: Sequence[Explanation]) -> list[Explanation]:
    """The explanations, and the twin of each that has one and is not among them."""
    known = {(e.effect.effect, e.effect.location) for e in found}
    result = list(found)
    for e in found:
        other = None if e.beside is not None else twin(e.effect)
        if other is not None and (other.effect, other.location) not in known:
            result.append(replace(e, fit=_renamed(e.fit, e.effect_index, other)))
    return result


def _renamed(fit: Fit, index: int, other: Effect) -> Fit:
    """The fit with one effect under its twin's name; the information keeps its size, its sign may turn."""
    old = fit.model.effects[index]
    a, b = (f"{e.location}.{e.effect}.delay" for e in (old, other))
    turned = old.parameters["delay"] * other.parameters["delay"] < 0.0
    information, gradient = fit.information.copy(), fit.gradient.copy()
    if turned and a in fit.free:
        place = fit.free.index(a)
        information[place], gradient[place] = -information[place], -gradient[place]
        information[:, place] = -information[:, place]
    names = tuple(b if n == a else n for n in fit.free)
    effects = (*fit.model.effects[:index], other, *fit.model.effects[index + 1 :])
    model = replace(
        fit.model, effects=effects, fixed=tuple(b if n == a else n for n in fit.model.fixed)
    )
    bounds = tuple(b if n == a else n for n in fit.at_bound)
    return replace(
        fit, model=model, free=names, information=information, gradient=gradient, at_bound=bounds
    )
