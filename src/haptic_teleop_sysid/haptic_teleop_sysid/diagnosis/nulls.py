"""How much would recordings show in which nothing is hidden?  The same search on simulated ones.

The re-estimated structure is driven by the recorded commands and disturbed as the recordings were: by torques
of the fitted size and memory, and by the encoders' steps.  What the search then comes upon is chance (a
parametric bootstrap, Efron and Tibshirani 1993, ch. 6), and a finding has to exceed it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from joblib import Parallel, delayed

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.parallel import by_itself
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

from .decide import significant
from .doubt import doubted
from .null_records import disturbed_as, null_record
from .scales import within_reach
from .search import SearchResult, search


@dataclass(frozen=True)
class Null:
    """What the search found where nothing was: the ``score`` (nats) of the best explanation, at least 0, and
    whether it would have been believed, or doubted as something unknown."""

    score: float
    alarm: bool


def nulls(
    model: Model,
    result: SearchResult,
    estimation: Sequence[Record],
    validation: Sequence[Record],
    count: int,
    *,
    sense_follows: bool = False,
    seed: int = 1,
    jobs: int = -1,
    progress: Callable[[str], None] | None = None,
) -> list[Null]:
    """The search on ``count`` simulated sets of recordings without any effect beyond the model's own; the
    model is believed as it was given, so that its re-estimation is part of the chance.  ``jobs``: processes,
    -1 for all cores."""
    if progress is not None:
        progress(f"the same search on {count} simulated sets of recordings with nothing hidden")
    fit = result.baseline
    learn, judge = ([(disturbed_as(fit, r), r) for r in records] for records in (estimation, validation))
    one = delayed(by_itself)
    tasks = (
        one(_null, model, fit, learn, judge, sense_follows, [seed, number]) for number in range(count)
    )
    found: Any = Parallel(n_jobs=jobs)(tasks)
    return list(found)


def _null(
    model: Model,
    fit: Fit,
    estimation: Sequence[tuple[NoiseModel, Record]],
    validation: Sequence[tuple[NoiseModel, Record]],
    sense_follows: bool,
    seed: list[int],
) -> Null:
    generator = np.random.default_rng(seed)
    learn = [null_record(fit, noise, r, generator) for noise, r in estimation]
    judge = [null_record(fit, noise, r, generator) for noise, r in validation]
    baseline = fit_from_scratch(model, learn, limits=within_reach(model))
    result = search(model, baseline, learn, judge, sense_follows=sense_follows)
    tried = [c.chosen for c in result.choices] or result.last_round
    score = max([0.0, *(e.score for e in tried if e.material and significant(e))])
    kept, doubt, _ = doubted(result, learn, judge, lambda candidate: 100.0)
    return Null(float(score), bool(kept.choices) or doubt is not None)


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
