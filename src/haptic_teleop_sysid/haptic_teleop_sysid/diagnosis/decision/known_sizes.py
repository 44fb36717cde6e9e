"""A group of the inverse dynamics without the effects of which nobody knows how much there is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from haptic_teleop_sim.model import Effect

from ..evidence.inverse_dynamics.witness import Group
from ..evidence.second_opinion import Errors, Heard, Opinion
from ..policy import LEAST_KNOWN
from .verdict import size_known


def with_known_sizes(opinion: Opinion, sized: Callable[[Heard], Heard], errors: Errors) -> Opinion:
    """The opinion, its sizes ``sized``, without effects whose size is not known to LEAST_KNOWN: the least
    known one is left out and the others are sized anew, until all are known or one is left. ``errors``: of
    free runs."""
    assert opinion.chosen is not None
    heard = sized(opinion.chosen)
    while len(heard.group.effects) > 1:
        known, least = min(
            (_known(heard.group, effect), i) for i, effect in enumerate(heard.group.effects)
        )
        if known >= LEAST_KNOWN:
            break
        group = _without(heard.group, least)
        group = replace(group, explained=opinion.witness.folds.explained(group.hypotheses))
        heard = sized(Heard(group, heard.gain, errors(group.model)))
    return replace(opinion, chosen=heard)


def _known(group: Group, effect: Effect) -> float:
    head = f"{effect.location}.{effect.effect}."
    return size_known(
        effect, {n: {"value": v, "std": group.std.get(head + n, 0.0)} for n, v in effect.parameters.items()}
    )


def _without(group: Group, index: int) -> Group:
    """The group without one of its effects, the others as they are."""
    effects = [*group.model.effects]
    del effects[len(effects) - len(group.effects) + index]
    gone = group.effects[index]
    std = {n: s for n, s in group.std.items() if not n.startswith(f"{gone.location}.{gone.effect}.")}
    hypotheses = (*group.hypotheses[:index], *group.hypotheses[index + 1 :])
    return replace(
        group, model=replace(group.model, effects=tuple(effects)), hypotheses=hypotheses, std=std
    )
