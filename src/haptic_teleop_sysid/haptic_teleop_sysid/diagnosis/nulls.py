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
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack, simulate
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import channels, innovations, settled
from haptic_teleop_sysid.estimation.noise import NoiseModel, observer
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

from .decide import significant
from .doubt import doubted
from .scales import within_reach
from .search import SearchResult, search


@dataclass(frozen=True)
class Null:
    """What the search found where nothing was: the ``score`` (nats) of the best explanation, at least 0, and
    whether it would have been believed, or doubted as something unknown."""

    score: float
    alarm: bool


def disturbed_as(fit: Fit, record: Record) -> NoiseModel:
    """The fitted noise model with levels as large as those of a recording.

    The likelihood knows levels only relative to each other and to the motor encoder's steps; how large they
    are shows in how much the observer had to correct, here against a recording made with the fitted ones.
    """
    made = null_record(fit, fit.noise, record, np.random.default_rng(0))
    rounding = np.square(record.resolution) / 12.0
    had, has = (_power(fit, r) - rounding for r in (record, made))
    factor = np.sqrt(np.clip(had / np.maximum(has, 1e-30), 1e-6, 1e4))
    motor, arm = float(factor[0]), float(factor[1])
    return fit.noise.scaled(motor_torque=motor, arm_torque=arm, arm_angle=arm)


def _power(fit: Fit, record: Record) -> NDArray[np.float64]:
    """Mean squares of the innovations, (2,); 0 for an encoder that is not there."""
    errors = settled(record, innovations(pack(fit.model), fit.noise, record).innovation)
    return np.mean(np.square(errors), axis=0)


def null_record(fit: Fit, noise: NoiseModel, record: Record, generator: np.random.Generator) -> Record:
    """A recording of the fitted model under the same command, disturbed as the noise model says."""
    packed, n = pack(fit.model), len(record)
    path = simulate(
        fit.model,
        record.input,
        record.dt,
        record.initial_state(),
        exogenous=record.exogenous,
        t0=record.start,
    )
    # The disturbances' answer is added: exact for a linear structure, and small.
    transition, _, _ = observer(packed, noise, record.dt, channels(packed, record))
    decay = np.array(noise.decay(record.dt))
    level = np.array([noise.motor_torque, noise.arm_torque])
    drawn = generator.standard_normal((n, 2)) * level * np.sqrt(1.0 - decay**2)
    state, moved = np.zeros(6), np.empty((n, 2))
    state[4:] = level * generator.standard_normal(2)
    for k in range(n):
        moved[k] = state[:2]
        state = transition @ state
        state[4:] += drawn[k]
    if packed.rigid:
        moved[:, 1] = moved[:, 0]
    steps = np.maximum(np.array(record.resolution), 1e-12)
    # What the readings scatter by beyond their steps.
    more = np.sqrt(np.maximum(np.array([noise.motor_angle, noise.arm_angle]) ** 2 - steps**2 / 12.0, 0.0))
    read = np.column_stack([path.motor_position, path.arm_position]) + moved
    read += more * generator.standard_normal((n, 2))
    measured = np.where(np.isfinite(record.measured), np.rint(read / steps) * steps, np.nan)
    return replace(record, name=f"{record.name}, nothing hidden", measured=measured)


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
    one = delayed(_null)
    tasks = (one(model, fit, learn, judge, sense_follows, [seed, number]) for number in range(count))
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
