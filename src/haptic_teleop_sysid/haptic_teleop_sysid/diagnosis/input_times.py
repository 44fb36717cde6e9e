"""When the input of recordings acts, held or read at its samples, on time or late, and what explains them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.recordings.dataset import DataSet

from .decision.late_input import Late, late_input
from .evidence.inverse_dynamics.witness import witness
from .evidence.lateness import is_lateness
from .explain import Explained, explain
from .inputs.between_samples import as_read, half_a_sample, may_be_read, predicted_better
from .inputs.on_time import on_time
from .inputs.scales import recording_scales
from .usable import records_of


def explained(
    model: Model, estimation: list[DataSet], validation: list[DataSet], say: Callable[[str], None]
) -> tuple[Explained, bool]:
    """What is made of recordings, on time where their input turns out to be late, and whether it was taken as
    read: of logs, as less is missing (see `inputs.between_samples`)."""
    found, read = _held_or_read(model, estimation, validation, say)
    if any(d.commanded_input is not None for d in (*estimation, *validation)):
        return found, read  # the currents show what is late
    say("asking whether the input is late")
    late = _late(model, found)
    if late is None:
        return found, read
    say("the same with the input on time")

    def moved(data: DataSet) -> DataSet:
        return on_time(as_read(data) if read else data, late.delay)

    try:
        again = explain(model, [*map(moved, estimation)], [*map(moved, validation)], say)
    except FAILURES:
        return found, read
    return replace(again, late=late, as_recorded=found), read


def _late(model: Model, found: Explained) -> Late | None:
    """The lateness of the input beside names that are none: those that the inverse dynamics believe, else
    those of the search, else what the inverse dynamics name first. Where none is there, the search has
    asked."""
    for one in _named(found):
        effects = tuple(e for e in one.effects if not is_lateness(e.entry))
        if len(effects) > len(model.effects):
            break
    else:
        return None
    named = replace(one, effects=effects, fixed=model.fixed)
    with suppress(*FAILURES):
        return late_input(named, model, found.result.baseline, found.result.scales, found.learn, found.judge)
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
