"""How the input of recordings acts between samples, held or read, and what explains them then."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.recordings.dataset import DataSet

from .evidence.inverse_dynamics.group_search import search_groups
from .explain import Explained, explain
from .inputs.between_samples import as_read, half_a_sample, may_be_read, predicted_better
from .inputs.scales import recording_scales
from .usable import records_of


def explained(
    model: Model, estimation: list[DataSet], validation: list[DataSet], say: Callable[[str], None]
) -> tuple[Explained, bool]:
    """What is made of recordings, and whether their input was then taken as read: of logs, as less
    is missing (see `inputs.between_samples`)."""
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
        leader = search_groups(model, learn, judge, recording_scales(model, learn)).most_likely
    except FAILURES:
        return
    if leader is not None:
        yield model.with_effects(*leader.effects)
