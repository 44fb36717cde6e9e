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
    for other in effect.entry.equivalents:
        if not other.condition and other.numbers and effect.location.endswith(other.at):
            numbers = other.numbers(effect.parameters)
            if numbers:
                return Effect(other.effect, effect.location, numbers)
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
    """The fit with one effect under its twin's name, both with one parameter; the information keeps its size,
    its sign may turn."""
    old = fit.model.effects[index]
    (a, size), (b, same) = (
        (f"{e.location}.{e.effect}.{n}", v) for e in (old, other) for n, v in e.parameters.items()
    )
    turned = size * same < 0.0
    information, gradient = fit.information.copy(), fit.gradient.copy()
    if turned and a in fit.free:
        place = fit.free.index(a)
        information[place], gradient[place] = -information[place], -gradient[place]
        information[:, place] = -information[:, place]
    names = tuple(b if n == a else n for n in fit.free)
    effects = (*fit.model.effects[:index], other, *fit.model.effects[index + 1 :])
    model = replace(fit.model, effects=effects, fixed=tuple(b if n == a else n for n in fit.model.fixed))
    bounds = tuple(b if n == a else n for n in fit.at_bound)
    return replace(fit, model=model, free=names, information=information, gradient=gradient, at_bound=bounds)
