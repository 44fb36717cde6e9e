"""An input that acts later than it is recorded, beside names that are no lateness."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import innovations
from haptic_teleop_sysid.estimation.records import Record

from ...evidence.certainty import standard_errors
from ...evidence.feedback import answers
from ...evidence.held_out import held_out_fit, judged
from ...evidence.lateness import Along, along, late_fits
from ...hypotheses.explanation import Explanation
from ...hypotheses.follows import is_lateness
from ...hypotheses.twins import with_twins
from ...inputs.scales import Scales, within_reach
from ...policy import CLEAR_GAIN, LEAST_HELD_OUT, SUREST
from ..adequacy import NOT_SURE
from ..finding import finding
from ..search.decide import Choice, choose
from ..search.rounds import SearchResult
from ..verdict import Verdict
from ..where import condition_of

#: Samples from which a channel is late: less lies between the ways in which inputs are written to a log.
LEAST_SAMPLES = 1.0
#: Share of what stretches gain by a lateness of their own that the one of all gains, and of that what those
#: lose that are predicted worse with it.
ONE_FOR_ALL, OBJECT = 0.8, 0.1


@dataclass(frozen=True)
class Late:
    """``choice``: the lateness and what else it may be; ``delay``: s by which the input acts after the time
    it is recorded with, negative: before."""

    choice: Choice
    delay: float


def late_input(
    named: Model,
    lab: Model,
    baseline: Fit,
    scales: Scales,
    estimation: Sequence[Record],
    validation: Sequence[Record],
) -> Late | None:
    """The lateness of the input beside the effects of ``named``, None where there is none beyond doubt: it
    gains as much as any further effect has to, and no lag is likelier, the other recordings bear it out as it
    is, it is a sample or more, and one and the same in all stretches of both kinds. ``lab``,
    ``baseline``: the structure, as given and fitted."""
    records = [*estimation, *validation]
    limits, least = within_reach(lab, scales), LEAST_SAMPLES * max(r.dt for r in records)
    fits = late_fits(named, baseline.noise, estimation, limits, least)
    if fits is None:
        return None
    found = judged(fits.named, fits.late, estimation, validation, scales)
    so_far = max(fits.named.log_likelihood - baseline.log_likelihood, 0.0)
    choice = choose(with_twins(found), so_far, sense_follows=False, further=True)
    stamped = next((e for e in found if e.effect.entry.kind == "skew"), None)
    # What has no other name smears the input, too: a lag, of which no recordings on time can be made.
    if choice is None or stamped is None or not choice.chosen.effect.entry.equivalents:
        return None
    if stamped.gain + stamped.held_out < CLEAR_GAIN or stamped.held_out < LEAST_HELD_OUT:
        return None
    (stamp,) = stamped.effect.parameters.values()
    if abs(stamp) < least or (stamp > 0.0 and _answers(stamped.fit, records)):
        return None
    # A disturbance may be larger on another day.
    there = held_out_fit(stamped.fit, validation, [stamped.fit.noise])
    seen = along(stamped.effect_index, [(stamped.fit, estimation), (there, validation)])
    if seen is None or not _steady(seen):
        return None
    return Late(_with_error_of_stretches(choice, seen), -stamp)


def _answers(fit: Fit, records: Sequence[Record]) -> bool:
    """Whether the input of one of the recordings is a controller's. That has the noise of readings in it, as
    if the motion began before the torque; in an open loop nothing does."""
    packed = pack(fit.model)
    return any(answers(r, innovations(packed, fit.noise, r).innovation) for r in records)


def _steady(seen: Along) -> bool:
    """Whether one lateness is right all along."""
    own, shared = float(np.sum(seen.own)), float(np.sum(seen.shared))
    return shared > ONE_FOR_ALL * own and float(np.sum(np.minimum(seen.shared, 0.0))) > -OBJECT * own


def _with_error_of_stretches(choice: Choice, seen: Along) -> Choice:
    """The choice with an error of its size that has in it what stretches differ by."""
    e = choice.chosen
    weight = seen.own / max(float(np.sum(seen.own)), 1e-300)
    mean = float(weight @ seen.sizes)
    apart = math.sqrt(float(weight @ (seen.sizes - mean) ** 2) / max(len(seen.sizes) - 1, 1))
    full = _full_name(e.effect)
    error = standard_errors(e.fit).get(full, 0.0)
    return replace(choice, chosen=replace(e, std={full: math.hypot(error, apart)}))


def with_lateness(
    late: Late, verdict: Verdict, result: SearchResult, baseline: Fit
) -> tuple[Verdict, SearchResult]:
    """Verdict and result of recordings that were asked on time, as those of the recordings as they are: the
    lateness is found, too, and the final model has it. ``baseline``: of the recordings as they are."""
    effect, (error,) = late.choice.chosen.effect, late.choice.chosen.std.values()
    bare = _without_lateness(result.final)

    def beside(one: Explanation) -> Explanation:
        fit = _with_known(bare, one.effect, error)
        return replace(one, fit=fit, effect_index=len(fit.model.effects) - 1)

    choice = replace(
        late.choice,
        chosen=beside(late.choice.chosen),
        others=tuple((beside(one), share) for one, share in late.choice.others),
    )
    final = choice.chosen.fit
    unknown = verdict.kind == "unknown"
    surest = SUREST if verdict.adequacy is None else verdict.adequacy.surest
    found = finding(choice, final, {}, NOT_SURE if unknown else surest)
    kind, where = verdict.kind, verdict.where
    if not unknown:
        kind = "ambiguous" if choice.ambiguous or kind == "ambiguous" else "identified"
        scores = [max(c.chosen.score, 0.0) for c in (*result.choices, choice)]
        share = scores[-1] / max(sum(scores), 1e-300)
        row = {
            "equation": effect.location,
            "share": round(share, 3),
            "condition": condition_of(baseline.model, effect.effect, effect.location, verdict.before),
            "intervals": [],
        }
        where = [*({**one, "share": round(one["share"] * (1.0 - share), 3)} for one in where), row]
    verdict = replace(verdict, kind=kind, where=where, findings=[*verdict.findings, found])
    return verdict, replace(result, baseline=baseline, final=final, choices=(*result.choices, choice))


def _without_lateness(fit: Fit) -> Fit:
    """The fit without what is left of a lateness in a stand-in for physics without a name."""
    effects = tuple(e for e in fit.model.effects if not is_lateness(e.entry))
    if len(effects) == len(fit.model.effects):
        return fit
    gone = {_full_name(e) for e in fit.model.effects if is_lateness(e.entry)}
    kept = [i for i, name in enumerate(fit.free) if name not in gone]
    return replace(
        fit,
        model=replace(
            fit.model, effects=effects, fixed=tuple(n for n in fit.model.fixed if n not in gone)
        ),
        free=tuple(fit.free[i] for i in kept),
        information=fit.information[np.ix_(kept, kept)],
        gradient=fit.gradient[kept],
    )


def _with_known(fit: Fit, effect: Effect, error: float) -> Fit:
    """The fit with one more effect, whose size is known to within ``error`` apart from all else."""
    known = len(fit.free)
    information = np.zeros((known + 1, known + 1))
    information[:known, :known] = fit.information
    information[known, known] = 1.0 / max(error, 1e-12) ** 2
    return replace(
        fit,
        model=fit.model.with_effects(effect),
        free=(*fit.free, _full_name(effect)),
        information=information,
        gradient=np.append(fit.gradient, 0.0),
    )


def _full_name(effect: Effect) -> str:
    (name,) = effect.parameters
    return f"{effect.location}.{effect.effect}.{name}"
