"""When the input of recordings acts, held or read at its samples, on time or late, and what explains them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.recordings.dataset import DataSet

from .decision.coloured import coloured
from .decision.late_input import Late, late_input
from .evidence.inverse_dynamics.witness import witness
from .evidence.lateness import is_lateness
from .explain import Explained, explain
from .inputs.between_samples import as_read, half_a_sample, may_be_read, predicted_better
from .inputs.on_time import on_time
from .inputs.scales import recording_scales
from .usable import records_of

#: How often recordings are moved in time until what is found on time asks for the same lateness, and samples
#: by which that may differ.
_MOST_MOVES, _THE_SAME = 3, 0.5


def explained(
    model: Model, estimation: list[DataSet], validation: list[DataSet], say: Callable[[str], None]
) -> tuple[Explained, bool]:
    """What is made of recordings, on time where their input turns out to be late, and whether it was taken as
    read: of logs, as less is missing (see `inputs.between_samples`)."""
    found, read = _held_or_read(model, estimation, validation, say)
    if any(d.commanded_input is not None for d in (*estimation, *validation)):
        return found, read  # the currents show what is late
    say("asking whether the input is late")
    searched = any(is_lateness(c.chosen.effect.entry) for c in found.kept.choices)
    if searched and not coloured(found.kept.final, found.learn, found.judge):
        return found, read  # it has asked, and its likelihoods hold
    late = _late(model, _names(model, found), found)
    for _ in range(_MOST_MOVES if late is not None else 0):
        assert late is not None
        say("the same with the input on time")
        moved = partial(on_time, delay=late.delay)
        sets = [[moved(as_read(d) if read else d) for d in data] for data in (estimation, validation)]
        try:
            again = explain(model, *sets, say)
        except FAILURES:
            break
        before, late = late, _late(model, _names(model, again) or model, found)
        if late is None:
            break
        if abs(late.delay - before.delay) < _THE_SAME * estimation[0].dt:
            return replace(again, late=late, as_recorded=found), read
    return found, read


def _late(model: Model, named: Model | None, found: Explained) -> Late | None:
    """The lateness of the input beside the effects of ``named``; None where it has none: then the search has
    asked."""
    if named is None:
        return None
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
    opinion = found.opinion
    if opinion is not None and opinion.chosen is not None:
        yield opinion.chosen.group.model
    if found.kept.choices:
        yield found.kept.final.model
    if opinion is not None and opinion.witness.most_likely is not None:
        yield opinion.witness.most_likely.model


def _held_or_read(
    model: Model, estimation: list[DataSet], validation: list[DataSet], say: Callable[[str], None]
) -> tuple[Explained, bool]:
    """What is made of recordings, and whether their input was then taken as read."""
    asked = may_be_read(estimation, validation)
    if asked and any(predicted_better(one, estimation) for one in _possible(model, estimation, validation)):
        return explain(model, [*map(as_read, estimation)], [*map(as_read, validation)], say), True
    found = explain(model, estimation, validation, say)
    named = [c.chosen.effect for c in found.kept.choices]
    if asked and half_a_sample(named, estimation[0].dt):
        say("the same with the input as read at its samples")
        again = explain(model, [*map(as_read, estimation)], [*map(as_read, validation)], say)
        if len(again.kept.choices) < len(named):
            return again, True
    return found, False


def _possible(model: Model, estimation: list[DataSet], validation: list[DataSet]) -> Iterator[Model]:
    """The model, and with the effects by which the inverse dynamics gain most: a missing friction hides
    what half a sample does."""
    yield model
    learn, judge = records_of(estimation), records_of(validation)
    try:
        leader = witness(model, learn, judge, recording_scales(model, learn)).most_likely
    except FAILURES:
        return
    if leader is not None:
        yield model.with_effects(*leader.effects)
