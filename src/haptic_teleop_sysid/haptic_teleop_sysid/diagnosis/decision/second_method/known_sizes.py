"""A group of the inverse dynamics without the effects of which nobody knows how much there is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from haptic_teleop_sim.model import Effect

from ...evidence.inverse_dynamics.searched_groups import Group
from ...evidence.second_method import Errors, JudgedGroup, SecondMethod, named_by, plainer
from ...policy import CLEARLY_LESS, LEAST_KNOWN
from ..finding import size_known


def with_known_sizes(
    second_method: SecondMethod, sized: Callable[[JudgedGroup], JudgedGroup], errors: Errors
) -> SecondMethod:
    """The second method's answer with its sizes ``sized`` and without effects whose size is not known to
    LEAST_KNOWN: the least known one is told in its plainer form, where that is in a group beside the same
    others, or left out, and the others are sized anew, until all are known or one is left. Sizes that free
    runs do not know stay those of the torques, where these know them. ``errors``: of free runs."""
    assert second_method.chosen is not None

    def known_sizes(before: JudgedGroup) -> JudgedGroup:
        after = sized(before)
        first, then = (_least_known(judged.group)[0] for judged in (before, after))
        spoilt = not then >= LEAST_KNOWN  # also where an error is no number
        return before if spoilt and first >= LEAST_KNOWN else after

    judged = known_sizes(second_method.chosen)
    while len(judged.group.effects) > 1:
        known, least = _least_known(judged.group)
        if known >= LEAST_KNOWN:
            break
        own = judged.group
        plain, other = _plainer(second_method, own, least), _instead(second_method, own, least)
        if plain is None and other is not None:
            second_method = _in_its_place(second_method, own, other)
        group = plain or other or _without(own, least)
        group = replace(group, explained=second_method.searched.folds.explained(group.hypotheses))
        judged = known_sizes(JudgedGroup(group, judged.gain, errors(group.model)))
    return replace(second_method, chosen=judged)


def _plainer(second_method: SecondMethod, group: Group, index: int) -> Group | None:
    """The group of the inverse dynamics with one effect in its plainer form and the same others; None where
    there is none."""
    names, own = named_by(group), group.hypotheses[index]
    asked = (other for level in second_method.searched.levels for other in level)
    found = (
        g for g in asked if plainer(named_by(g), names) and (own.entry.name, own.location) not in named_by(g)
    )
    return next(found, None)


def _instead(second_method: SecondMethod, group: Group, index: int) -> Group | None:
    """The rival with another effect of known size in place of one, beside the same others, that gains most,
    and hardly less: of a spring whose pull hardly changes the slope is not known, and a constant torque is.
    None where there is none."""
    gone = group.effects[index]
    others = named_by(group) - {(gone.effect, gone.location)}
    found = (
        judged.group
        for judged, _ in second_method.rivals
        if len(judged.group.effects) == len(group.effects)
        and others < named_by(judged.group) != named_by(group)
        and judged.group.gain > group.gain - CLEARLY_LESS
        and _least_known(judged.group)[0] >= LEAST_KNOWN
    )
    return max(found, key=lambda g: g.gain, default=None)


def _in_its_place(second_method: SecondMethod, gone: Group, group: Group) -> SecondMethod:
    """The answer in which a group has the weight of one that says the same, too, and the other has
    none."""
    names, gone_names = named_by(group), named_by(gone)
    others = [
        (judged, weight) for judged, weight in second_method.rivals if named_by(judged.group) != gone_names
    ]
    lost = sum(weight for _, weight in second_method.rivals) - sum(weight for _, weight in others)
    rivals = [(h, weight + lost * (named_by(h.group) == names)) for h, weight in others]
    return replace(second_method, rivals=tuple(sorted(rivals, key=lambda one: -one[1])))


def _least_known(group: Group) -> tuple[float, int]:
    """How surely the least known size of a group is known, and which effect's it is."""
    return min((_known(group, effect), i) for i, effect in enumerate(group.effects))


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
    return replace(group, model=replace(group.model, effects=tuple(effects)), hypotheses=hypotheses, std=std)
