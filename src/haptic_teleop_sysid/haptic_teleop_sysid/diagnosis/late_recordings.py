"""What explains recordings whose input turns out to be late, with the input at its time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.recordings.dataset import DataSet

from .decision.name_tests.late_input import Late, late_input
from .decision.search.decide import Choice
from .explain import Explained, explain
from .hypotheses.follows import is_lateness
from .inputs.on_time import on_time

#: How often recordings are moved in time until what is found on time asks for the same lateness, and samples
#: by which that may differ.
_MOST_MOVES, _THE_SAME = 3, 0.5


@dataclass(frozen=True)
class OnTime:
    """``late``: the lateness; ``explained``: what is made of recordings with their input at its time, and
    ``as_recorded``: as they are."""

    late: Late
    explained: Explained
    as_recorded: Explained

    def moved(self, data: DataSet) -> DataSet:
        """A recording with its input at its time."""
        return on_time(data, self.late.delay)


def explained_on_time(
    model: Model,
    kinds: tuple[list[DataSet], list[DataSet]],
    found: Explained,
    choices: tuple[Choice, ...],
    say: Callable[[str], None],
) -> OnTime | None:
    """What is made of both ``kinds`` of recordings with their input on time; None where that is not late
    beyond doubt, the currents would show it, the model has a lateness, or the search has found one that
    stands among the ``choices``; and of a joint that flexes, where what acts between its encoders may look
    like it.
    ``found``: what is made of them as they are."""
    known = any(is_lateness(e.entry) for e in model.effects)
    stands = known or any(is_lateness(c.chosen.effect.entry) and c.chosen.grounds is None for c in choices)
    if stands or not model.rigid or any(d.commanded_input is not None for data in kinds for d in data):
        return None
    say("asking whether the input is late")
    named, same = _names(model, found), _THE_SAME * max(d.dt for data in kinds for d in data)
    late = None if named is None else _late(model, named, found)
    for _ in range(_MOST_MOVES):
        if late is None:
            return None
        say("the same with the input on time")
        sets = [[on_time(d, late.delay) for d in data] for data in kinds]
        try:
            again = explain(model, *sets, say)
        except FAILURES:
            return None
        before, late = late, _late(model, _names(model, again) or model, found)
        if late is not None and abs(late.delay - before.delay) < same:
            return OnTime(before, again, found)
    return None


def _late(model: Model, named: Model, found: Explained) -> Late | None:
    """The lateness of the input beside the effects of ``named``."""
    with suppress(*FAILURES):
        return late_input(named, model, found.result.baseline, found.result.scales, found.learn, found.judge)
    return None


def _names(model: Model, found: Explained) -> Model | None:
    """The model with names that are no lateness: those that the inverse dynamics believe, else those of the
    search, else what the inverse dynamics name first."""
    for one in _named(found):
        effects = tuple(e for e in one.effects if not is_lateness(e.entry))
        if len(effects) > len(model.effects):
            return replace(one, effects=effects, fixed=model.fixed)
    return None


def _named(found: Explained) -> Iterator[Model]:
    second_method = found.second_method
    if second_method is not None and second_method.chosen is not None:
        yield second_method.chosen.group.model
    if found.kept.choices:
        yield found.kept.final.model
    if second_method is not None and second_method.searched.most_likely is not None:
        yield second_method.searched.most_likely.model
