"""Does the input act later, or earlier, than it is recorded, beside what else is missing?

A channel that is stamped late hides behind friction that is not in the model, and the other way round: alone,
neither predicts much better, and a search that adds one effect after another takes the nearest name of both.
So it is asked beside names that do not come from predictions (see `inverse_dynamics`). A lateness is one and
the same number all along: where it stands for something else, each stretch of the recordings wants another.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import FAILURES, by_sample, innovations, likelihood_of
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters
from haptic_teleop_sysid.estimation.records import Record, thinned_to
from haptic_teleop_sysid.estimation.step_limits import Limits
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from ..hypotheses.follows import is_lateness
from ..hypotheses.twins import twins
from ..policy import WORTH_ALL_SAMPLES
from ..starts.screen import Screened, screen
from ..starts.trials import best_of_each, better_baseline, finished, polish, quiet, trial

FloatArray = NDArray[np.float64]

#: Samples by which a channel is late where a fit starts.
_STARTS = (1.0, 3.0, 10.0, 30.0)
#: Steps of the fit of names that do not come from predictions; starts of each effect that are tried under
#: either noise model, and trials that are fitted to the end.
_STEPS_OF_NAMES, _MOST_TRIED, _MOST_ENDED = 30, 3, 2
#: Steps of the fit with weak disturbances, under which more is promised (see `starts.shortlist`).
_STILL = 12
#: Samples, and factors, by which a fit looks further: the likelihood has a kink at every sample.
_STEPS, _FACTORS, _MOST_HOPS = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0), (0.5, 1.5, 2.0), 3
#: Nats that another one must gain.
_BETTER = 1.0
#: Stretches of all recordings, about, and sizes at which each is asked, relative to the one of all.
STRETCHES = 8
_ASKED = (0.0, 0.25, 0.5, 0.7, 0.85, 1.0, 1.15, 1.3, 1.6, 2.0, 3.0)


@dataclass(frozen=True)
class LateFits:
    """``named``: a model with its names, fitted; ``late``: with an input that is late, or early, or lags,
    best first."""

    named: Fit
    late: list[Fit]


def late_fits(
    named: Model, noise: NoiseModel, records: Sequence[Record], limits: Limits, least: float
) -> LateFits | None:
    """Fits to the recordings; None where thinned ones promise nothing, or a lateness of less than half of
    ``least``, s."""
    few = thinned_to(records)
    near = fit_whole(named, noise, few, iterations=_STEPS_OF_NAMES, limits=limits)
    if not np.isfinite(near.log_likelihood):
        return None
    starts = [*_starts(named, records[0].dt)]
    still = fit_parameters(near.model, quiet(near.noise), few, iterations=_STILL, limits=limits)
    jobs = [
        (s.start, one)
        for one in (near, still)
        if np.isfinite(one.log_likelihood)
        for s in _most_promising(screen(one, few, starts))
    ]
    index = len(named.effects)

    def tried_from(job: tuple[Effect, Fit]) -> list[Fit]:
        return trial(job[1], job[1].model, [job[0]], [], few, job[1].noise, limits)

    ends = side_by_side(tried_from, jobs)
    found: list[Fit] = []
    for name in dict.fromkeys(s.effect for s in starts):
        tried = [one for end in ends for one in end if one.model.effects[index].effect == name]
        tried.sort(key=lambda one: -one.log_likelihood)
        found += side_by_side(lambda one: polish(one, few, limits), tried[:_MOST_ENDED])
    ahead = best_of_each(found, index)
    near = better_baseline(near, ahead[:1], few, limits)
    worth = [one for one in ahead if one.log_likelihood > near.log_likelihood + WORTH_ALL_SAMPLES]
    moved = [one for one in worth if one.model.effects[index].entry.kind == "skew"]
    if not any(abs(_size(one, index)) > 0.5 * least for one in moved):
        return None

    def to_the_end(one: Fit) -> Fit:
        return _hopped(finished(polish(one, records, limits), records, limits), index, records, limits)

    base = near
    if few is not records:
        base = fit_whole(near.model, near.noise, records, iterations=_STEPS_OF_NAMES, limits=limits)
    fits = best_of_each(side_by_side(to_the_end, worth), index)
    return LateFits(better_baseline(base, fits[:1], records, limits), fits)


def _most_promising(screened: Sequence[Screened]) -> list[Screened]:
    """Of each effect the starts that promise most, if it is enough for a fit."""
    worth = [s for s in screened if s.gain > WORTH_ALL_SAMPLES]
    names = dict.fromkeys(s.start.effect for s in worth)
    return [s for name in names for s in [w for w in worth if w.start.effect == name][:_MOST_TRIED]]


def _starts(model: Model, dt: float) -> Iterator[Effect]:
    """Every effect that moves the input in time, at some sizes, one name of each."""
    there = {(e.effect, e.location) for e in model.effects}
    known: set[tuple[str, str]] = set()
    for name, entry in sorted(EFFECTS.items(), key=lambda item: item[1].kind != "skew"):
        where = name, model.location("actuator")
        if "actuator" not in entry.where or not is_lateness(entry) or where in there | known:
            continue
        (p,) = (p for p in entry.parameters if p.default is None)
        for samples in (s * sign for s in _STARTS for sign in (1.0, -1.0)):
            if p.minimum < samples * dt < p.maximum:
                one = Effect(*where, {p.name: samples * dt})
                known |= {(e.effect, e.location) for e in twins(one, model.rigid)}
                yield one


def _sized(fit: Fit, index: int, size: float) -> Model:
    effects = list(fit.model.effects)
    own = effects[index]
    effects[index] = Effect(own.effect, own.location, dict.fromkeys(own.parameters, size))
    return replace(fit.model, effects=tuple(effects))


def _size(fit: Fit, index: int) -> float:
    (size,) = fit.model.effects[index].parameters.values()
    return size


def _within(fit: Fit, index: int, sizes: Sequence[float]) -> list[float]:
    (p,) = (p for p in fit.model.effects[index].entry.parameters if p.default is None)
    return [s for s in sizes if p.minimum < s < p.maximum]


def _hopped(fit: Fit, index: int, records: Sequence[Record], limits: Limits) -> Fit:
    """The fit, or a better one that starts at another size near by."""
    for _ in range(_MOST_HOPS):
        size, dt = _size(fit, index), records[0].dt
        near = [*(size + step * dt for step in _STEPS), *(size * factor for factor in _FACTORS)]
        models = [_sized(fit, index, s) for s in _within(fit, index, near)]
        try:
            values = [likelihood_of(pack(one), fit.noise, records) for one in models]
        except FAILURES:
            return fit
        best = int(np.argmax(values))
        if not values[best] > fit.log_likelihood + _BETTER:
            return fit
        again = finished(polish(replace(fit, model=models[best]), records, limits), records, limits)
        if not again.log_likelihood > fit.log_likelihood:
            return fit
        fit = again
    return fit


@dataclass(frozen=True)
class Along:
    """What stretches of recordings say of a lateness: ``sizes`` (stretches,), s, that predict each best, what
    these gain there over none, ``own``, and what the one of all gains, ``shared``, nats."""

    sizes: FloatArray
    own: FloatArray
    shared: FloatArray


def along(index: int, told: Sequence[tuple[Fit, Sequence[Record]]]) -> Along | None:
    """The lateness of a model, stretch by stretch of recordings that are ``told`` with the fit whose noise is
    theirs, all else as it is; None where it cannot be computed."""
    first, pairs = told[0][0], [(fit, record) for fit, records in told for record in records]
    size = _size(first, index)
    asked = np.array([size * share for share in _ASKED])
    asked = asked[np.isin(asked, [0.0, *_within(first, index, asked.tolist())])]
    parts = max(1, round(STRETCHES / len(pairs)))
    rows = []
    for one in asked:
        packed, nats = pack(_sized(first, index, float(one))), []
        for fit, record in pairs:
            try:
                each = by_sample(packed, record, innovations(packed, fit.noise, record).innovation)
            except FAILURES:
                return None
            nats += [float(np.sum(part)) for part in np.array_split(each, parts)]
        rows.append(nats)
    found = np.array(rows)
    if not np.all(np.isfinite(found)):
        return None
    gained = found - found[0]
    best = np.argmax(gained, axis=0)
    return Along(asked[best], np.max(gained, axis=0), gained[int(np.argmin(np.abs(asked - size)))])
