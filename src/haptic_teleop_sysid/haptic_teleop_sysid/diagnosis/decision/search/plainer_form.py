"""A richer form of friction that is its plainer form by the time that everything else is found.

Named early it may stand for what comes to light later: beside that, its shape is worth nothing, and it says
no more than the plainer form does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ...hypotheses.explanation import by_chance
from ...starts.forms import instead
from ...starts.trials import LAST_STEPS
from .decide import Choice


def told_plainly(choices: Sequence[Choice], records: Sequence[Record], limits: Limits) -> list[Choice]:
    """The choices of a search, one effect each, of which the last has the fit of all: richer forms whose
    shape gains no more beside all others than parameters gain by chance are plain ones."""
    found = list(choices)
    for number in range(len(choices) - 1):
        choice, last = found[number], found[-1].chosen.fit
        plain = _plainer(choice)
        if plain is None:
            continue
        index = choice.chosen.effect_index
        without = _refitted(last, index, plain, records, limits)
        spared = by_chance(choice.chosen.effect) - by_chance(plain)
        if not last.log_likelihood - without.log_likelihood < spared:
            continue
        fits = [_refitted(c.chosen.fit, index, plain, records, limits) for c in found[number:-1]]
        found[number] = _as_plain(choice, plain)
        for place, fit in enumerate([*fits, without], start=number):
            found[place] = replace(found[place], chosen=replace(found[place].chosen, fit=fit))
    return found


def _as_plain(choice: Choice, plain: Effect) -> Choice:
    """The choice of the plain form, with what speaks for that where it was judged, and with its share of the
    confidence."""
    chosen, confidence = replace(choice.chosen, gains=None), choice.confidence
    others = []
    for rival, share in choice.others:
        if (rival.effect.effect, rival.effect.location) == (plain.effect, plain.location):
            chosen, confidence = rival, confidence + share
        else:
            others.append((rival, share))
    return replace(choice, chosen=chosen, confidence=confidence, others=tuple(others))


def _plainer(choice: Choice) -> Effect | None:
    """The plainer form of a choice's effect, of the same size; None where it has none."""
    effect, own = choice.chosen.effect, choice.chosen.effect.entry.refinement
    if own is None or choice.chosen.beside is not None:
        return None
    size = next((v for n, v in effect.parameters.items() if effect.entry.parameter(n).unit == "N*m"), 0.0)
    plain = EFFECTS[own.of]
    kept = {n: v for n, v in effect.parameters.items() if n in {p.name for p in plain.parameters}}
    return Effect(own.of, effect.location, {**kept, plain.parameters[0].name: size})


def _refitted(fit: Fit, index: int, effect: Effect, records: Sequence[Record], limits: Limits) -> Fit:
    model = instead(fit.model, index, effect)
    return fit_whole(model, fit.noise, records, iterations=LAST_STEPS, limits=limits)
