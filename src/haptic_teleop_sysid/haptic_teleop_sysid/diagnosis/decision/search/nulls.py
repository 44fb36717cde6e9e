"""How much would recordings show in which nothing is hidden?  The same diagnosis of simulated ones.

The re-estimated structure is driven by the recorded commands and disturbed as the recordings were: by torques
of the fitted size and memory, and by the encoders' steps.  What the diagnosis then comes upon is chance (a
parametric bootstrap, Efron and Tibshirani 1993, ch. 6), and a finding has to exceed it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.parallel import at_most, by_itself
from haptic_teleop_sysid.recordings.dataset import DataSet

from ...evidence.null_records import levels_of, null_dataset
from .decide import significant
from .rounds import SearchResult


@dataclass(frozen=True)
class Null:
    """What the search found where nothing was: the ``score`` (nats) of the best explanation, at least 0, and
    whether it would have been believed, or doubted as something unknown."""

    score: float
    alarm: bool


#: A diagnosis of (model, estimation, validation): what the search found, and whether that raises an alarm.
Diagnosis = Callable[[Model, list[DataSet], list[DataSet]], tuple[SearchResult, bool]]


def nulls(
    diagnosis: Diagnosis,
    model: Model,
    result: SearchResult,
    estimation: Sequence[DataSet],
    validation: Sequence[DataSet],
    count: int,
    *,
    seed: int = 1,
    jobs: int = -1,
    progress: Callable[[str], None] | None = None,
) -> list[Null]:
    """A ``diagnosis`` of ``count`` simulated sets of recordings without any effect beyond the model's own;
    the model is believed as it was given, so that its re-estimation is part of the chance.  ``jobs``:
    processes, -1 for all cores that there is memory for."""
    if progress is not None:
        progress(f"the same search on {count} simulated sets of recordings with nothing hidden")
    fit = result.baseline
    parts = [[(d, levels_of(fit, d)) for d in data] for data in (estimation, validation)]
    from joblib import Parallel, delayed  # importing it takes long

    one = delayed(by_itself)
    tasks = (one(_null, diagnosis, model, fit, *parts, [seed, number]) for number in range(count))
    found: Any = Parallel(n_jobs=at_most() if jobs < 0 else jobs)(tasks)
    return list(found)


def _null(
    diagnosis: Diagnosis,
    model: Model,
    fit: Fit,
    estimation: Sequence[tuple[DataSet, Sequence[NoiseModel]]],
    validation: Sequence[tuple[DataSet, Sequence[NoiseModel]]],
    seed: list[int],
) -> Null:
    generator = np.random.default_rng(seed)
    learn, judge = (
        [null_dataset(fit, d, levels, generator) for d, levels in part] for part in (estimation, validation)
    )
    result, alarm = diagnosis(model, learn, judge)
    tried = [c.chosen for c in result.choices] or result.last_round
    score = max([0.0, *(e.score for e in tried if e.material and significant(e))])
    return Null(float(score), alarm)


def beyond_chance(result: SearchResult, chance: Sequence[Null]) -> SearchResult:
    """The result without findings that score no better in the motion than the best of ``chance``, and what
    was found after them; what the measured current gives is not judged by it.  The nulls are the first
    round's: to a second or third finding they are a guide, and no level."""
    highest = max((one.score for one in chance), default=0.0)
    kept = list(result.choices)
    nameless = result.nameless
    if nameless is not None and nameless.chosen.score <= highest:
        nameless = None
    for number, choice in enumerate(result.choices):
        if choice.chosen.by_current <= 0.0 and choice.chosen.score <= highest:
            kept = kept[:number]
            break
    if len(kept) == len(result.choices):
        return replace(result, nameless=nameless)
    final = kept[-1].chosen.fit if kept else result.baseline
    return replace(result, choices=tuple(kept), final=final, nameless=None)
