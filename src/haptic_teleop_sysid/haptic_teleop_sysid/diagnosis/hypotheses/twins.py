"""Effects that are one and the same thing to any recording of these channels.

A reading that is late and a reading that is stamped late cannot be told apart, nor a torque that is late from
a command that is stamped early, nor in a rigid joint any of these from the others.  The search may come upon
one of them only; all are put up for choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit

from .explanation import Explanation


def twins(effect: Effect, rigid: bool) -> list[Effect]:
    """The other names of the same thing, in a joint that is ``rigid`` or not."""
    found = [effect]
    for one in found:  # which grows: a twin may have another one
        known = {(e.effect, e.location) for e in found}
        found += [e for e in _next(one, rigid) if (e.effect, e.location) not in known]
    return found[1:]


def _next(effect: Effect, rigid: bool) -> list[Effect]:
    found = []
    for other in effect.entry.equivalents:
        part = next((at for at in other.at if effect.location.endswith(at)), None)
        if part is None or other.condition or other.numbers is None or (other.rigid and not rigid):
            continue
        if numbers := other.numbers(effect.parameters):
            location = effect.location.removesuffix(part) + (other.place or part)
            found.append(Effect(other.effect, location, numbers))
    return found


def with_twins(found: Sequence[Explanation]) -> list[Explanation]:
    """The explanations, and the twins of each that are not among them, nor in the model already; a twin that
    is among them and was fitted less well gets the better one's fit, as no recording tells them apart. What a
    measured current shows lies before the joint, be that rigid or not."""
    result = list(found)
    for e in found:
        model = e.fit.model
        there = {(one.effect, one.location) for one in model.effects}
        rigid = model.rigid and e.by_current <= 0.0
        for other in [] if e.beside is not None else twins(e.effect, rigid):
            if _key(other) in there:
                continue
            same = [k for k, one in enumerate(result) if _key(one.effect) == _key(other)]
            if not same:
                result.append(_as(e, other))
            for k in same:
                known = result[k]
                if known.beside is None and (known.by_current > 0.0) == (e.by_current > 0.0):
                    result[k] = max(known, _as(e, other), key=lambda one: one.gain + one.elsewhere)
    return result


def _key(effect: Effect) -> tuple[str, str]:
    return effect.effect, effect.location


def _as(one: Explanation, other: Effect) -> Explanation:
    fit = _renamed(one.fit, one.effect_index, other)
    names = dict(zip(one.fit.free, fit.free, strict=True))
    return replace(one, fit=fit, std={names.get(name, name): std for name, std in one.std.items()})


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
