"""What a search finds in recordings, and what is left of it after chance and the questions that likelihoods
do not ask; once more with the input on time, where that is late."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet

from .decision.reasons import Doubt
from .decision.search.decide import Choice
from .decision.search.nulls import Null, beyond_chance, nulls
from .decision.search.rounds import SearchResult
from .decision.stand import Stand
from .explain import Explained
from .hypotheses.follows import is_lateness
from .input_times import explained
from .inputs.between_samples import as_read
from .inputs.uses import Uses
from .late_recordings import OnTime, explained_on_time
from .question import questioned

Say = Callable[[str], None]


@dataclass(frozen=True)
class Believed:
    """What was ``found`` in the recordings of ``uses``, with the input on time; ``estimation``: those that
    were fitted to, likewise; ``result``: what is left, ``doubt``: why something else is there, ``stand``: of
    the names; ``chance``: what was found where nothing is hidden, and ``dropped``: what did not exceed it;
    ``read``: whether the input was taken as read at its samples; ``timely``: the lateness of the input, and
    what is made of recordings with it and without, None where it is not late."""

    found: Explained
    uses: Uses
    estimation: list[DataSet]
    result: SearchResult
    doubt: Doubt | None
    stand: Stand
    chance: tuple[Null, ...]
    dropped: tuple[Choice, ...]
    read: bool
    timely: OnTime | None = None


def believed(model: Model, uses: Uses, say: Say, null_count: int = 0) -> Believed:
    """What is believed of recordings. With ``null_count`` the same is done with that many simulated sets of
    recordings in which nothing is hidden, and a finding has to exceed what is found there."""
    found, read = explained(model, [*uses.fit], [*uses.choose], say)
    uses = uses.changed(as_read) if read else uses
    kinds = [*uses.fit], [*uses.choose]
    chance: list[Null] = []
    if null_count:
        chance = nulls(alarm, model, found.result, *kinds, null_count, progress=say)
    say("checking what was found")
    first = Believed(found, uses, kinds[0], *_left(found, chance, kinds), read)
    if not first.result.choices and first.doubt is None:
        return first
    timely = explained_on_time(model, kinds, found, first.result.choices, say)
    if timely is None:
        return first
    moved = uses.changed(timely.moved)
    left = _left(timely.explained, chance, ([*moved.fit], [*moved.choose]))
    if any(is_lateness(c.chosen.effect.entry) for c in left[0].choices):
        return first
    return Believed(timely.explained, uses, [*moved.fit], *left, read, timely)


def alarm(model: Model, estimation: list[DataSet], validation: list[DataSet]) -> tuple[SearchResult, bool]:
    """What the search finds, and whether the diagnosis would name or doubt anything: for `nulls`."""
    found, _ = explained(model, estimation, validation, lambda text: None)
    result, doubt, _ = questioned(found, found.result, found.kept, [*estimation, *validation])
    return found.result, bool(result.choices) or doubt is not None


def _left(
    found: Explained, chance: Sequence[Null], kinds: tuple[list[DataSet], list[DataSet]]
) -> tuple[SearchResult, Doubt | None, Stand, tuple[Null, ...], tuple[Choice, ...]]:
    """What is left of the findings after chance and `questioned`; ``chance``, and what fell by it."""
    data = [*kinds[0], *kinds[1]]
    if not chance:
        return *questioned(found, found.result, found.kept, data), (), ()
    beyond, kept = beyond_chance(found.result, chance), found.kept
    dropped: tuple[Choice, ...] = ()
    if not found.freely:  # what only a simulation found has no score that chance could be held against
        kept = beyond_chance(found.kept, chance)
        dropped = found.kept.choices[len(kept.choices) :]
    return *questioned(found, beyond, kept, data), tuple(chance), dropped
