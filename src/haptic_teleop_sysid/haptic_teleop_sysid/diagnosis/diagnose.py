"""One diagnosis from data sets to verdict: baseline, search, second opinion, chance, doubt, proof."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.dataset import DataSet
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.records import Record, records_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

from .adequacy import adequacy, short_of
from .columns import column, errors_of, three_columns, with_bounds
from .consistency import refuse_other_units, refuse_unrelated
from .contents import contents
from .current import shown_by_current
from .cuts import FEWEST_SAMPLES
from .decide import Choice
from .doubt import coloured, doubted
from .inverse_dynamics.motion import motion_band
from .inverse_dynamics.witness import witness
from .measured_map import measured_map
from .nulls import Null, beyond_chance, nulls
from .overruled import as_result, believed_instead, beyond_reach, inadequate
from .own_quantity import follows_still
from .plausible import refuse_copies, refuse_idle, refuse_kinematic, refuse_motionless
from .policy import HARM
from .proof import Course, Proof, mean_percent, prove
from .reasons import Doubt, off_the_mark, runs_away, slipped
from .scales import recording_scales, within_reach
from .search import LEAST_PERCENT, POOR_FIT, SearchResult, search, search_by_simulation
from .second_opinion import Opinion, second_opinion
from .stand import Stand
from .stand_in import stand_in
from .testimony import testimony
from .uses import three_uses
from .verdict import Verdict, decide_verdict

#: Difference (A or N·m, relative to the rms command) up to which the measured current counts as following.
_FOLLOWS = 0.1


def records_of(data: list[DataSet]) -> list[Record]:
    """Records driven by the command, cut apart at holes; refused where there is nothing to learn from."""
    records = []
    for dataset in data:
        pieces = records_from(dataset, commanded=True)
        longest = max(pieces, key=len)
        if len(longest) < FEWEST_SAMPLES:
            raise RecordingError(
                f"{dataset.name} has {len(longest)} samples without a hole; a diagnosis needs at least "
                f"{FEWEST_SAMPLES}: record for longer."
            )
        refuse_motionless(longest, dataset.joint)
        refuse_unrelated(longest, dataset.joint)
        records += [piece for piece in pieces if len(piece) >= FEWEST_SAMPLES]
    return records


def sense_follows(data: list[DataSet]) -> bool:
    """Whether a measured current was recorded that follows its command without further delay."""
    for dataset in data:
        if dataset.commanded_input is None or dataset.input_source != "measured effort":
            return False
        rms = float(np.std(dataset.commanded_input))
        noise = 0.02 if dataset.input_unit == "A" else 0.0
        if float(np.std(dataset.input - dataset.commanded_input)) > _FOLLOWS * rms + noise:
            return False
    return True


def unharmful(result: SearchResult, percent: Callable[[Model], float]) -> SearchResult:
    """The search's result without the last effects while those spoil the free simulation of the validation
    recordings: what predicts the next sample better but runs away when it runs freely is no explanation."""
    kept = list(result.choices)
    before = percent(result.baseline.model)
    while kept and percent(kept[-1].chosen.fit.model) < before - HARM:
        kept.pop()
    if len(kept) == len(result.choices):
        return result
    final = kept[-1].chosen.fit if kept else result.baseline
    return replace(result, choices=tuple(kept), final=final, last_round=())


@dataclass(frozen=True)
class Explained:
    """What the search makes of recordings, before chance and doubt: the ``given`` model; the records of both
    kinds of recordings (``learn``, ``judge``), ``course`` of all data sets, of which the first ``count`` are
    the estimation's, and ``coarse``: the same, thinned, where models are compared; ``result`` of the search
    by prediction, ``kept``: that without what harms, or what only the search by simulation found
    (``freely``); ``opinion``: the second one, None where the arithmetic of the inverse dynamics failed."""

    given: Model
    learn: list[Record]
    judge: list[Record]
    course: Course
    coarse: Course
    count: int
    result: SearchResult
    kept: SearchResult
    freely: bool
    opinion: Opinion | None

    def chosen_by(self, candidate: Model) -> float:
        """Simulated fit of a model on the validation recordings, percent."""
        return float(np.mean(self.coarse.percent(candidate)[self.count :]))

    def errors(self, candidate: Model) -> tuple[float, float]:
        """See `second_opinion.Errors`."""
        return free_errors(self.coarse, self.count, candidate)


def free_errors(course: Course, count: int, candidate: Model) -> tuple[float, float]:
    """See `second_opinion.Errors`; the first ``count`` recordings of the course are the estimation's."""
    errors = 1.0 - np.array(course.percent(candidate)) / 100.0
    return float(np.mean(errors[:count])), float(np.mean(errors[count:]))


def refuse_unusable(recordings: Sequence[DataSet]) -> None:
    """Raise RecordingError for recordings that a diagnosis cannot use, alone or together."""
    refuse_copies(recordings)
    refuse_idle(recordings)
    records = records_of([*recordings])
    for dataset in recordings:
        refuse_kinematic(dataset)
    refuse_other_units(records)


def explain(
    model: Model, estimation: list[DataSet], validation: list[DataSet], say: Callable[[str], None]
) -> Explained:
    """Baseline and search, on recordings and on simulated ones alike."""
    n, everything = len(estimation), [*estimation, *validation]
    learn, judge = records_of(estimation), records_of(validation)
    say("re-estimating the given structure")
    baseline = fit_from_scratch(model, learn, limits=within_reach(model, recording_scales(model, learn)))
    if not np.isfinite(baseline.log_likelihood):
        raise RecordingError(
            f"{model.source} predicts nothing of {estimation[0].name}, whatever its parameters: see whether "
            "its inertias, and the units and signs of the recording, are what they should be."
        )
    course = Course.of(baseline.model, everything)
    coarse = course.coarse(motion_band([*learn, *judge]))
    result = search(
        model,
        baseline,
        learn,
        judge,
        sense_follows=sense_follows(estimation),
        shown=shown_by_current(model, estimation, validation),
        percent=lambda candidate: float(np.mean(coarse.percent(candidate))),
        progress=say,
    )

    def percent(candidate: Model) -> tuple[float, float]:
        fits = coarse.percent(candidate, "position")
        return float(np.mean(fits[:n])), float(np.mean(fits[n:]))

    kept = unharmful(result, lambda candidate: float(np.mean(coarse.percent(candidate)[n:])))
    freely = False
    poor = min(percent(kept.final.model)) < POOR_FIT or (result.choices and not kept.choices)
    if poor and result.nameless is None:
        say("searching by free simulation")
        free = search_by_simulation(model, result.baseline, learn, judge, percent=percent, progress=say)
        gained = sum(percent(free.final.model)) - sum(percent(kept.final.model))
        if free.choices and (not kept.choices or gained > LEAST_PERCENT):
            kept, freely = free, True
    say("asking the inverse dynamics")

    def errors(candidate: Model) -> tuple[float, float]:
        return free_errors(coarse, n, candidate)

    scales = result.scales
    try:
        said = witness(model, learn, judge, scales)
        alone = (model, result.baseline.model, said.structure.model)
        opinion = second_opinion(said, scales, errors, min(map(errors, alone)))
    except FAILURES:
        opinion = None
    return Explained(model, learn, judge, course, coarse, n, result, kept, freely, opinion)


def questioned(
    found: Explained, believed: SearchResult, kept: SearchResult, data: list[DataSet]
) -> tuple[SearchResult, Doubt | None, Stand]:
    """What is left of the findings ``kept`` after the questions that likelihoods do not ask; ``believed``:
    what the search by prediction found, so far as chance leaves it."""
    harmful = None if kept.choices else next(iter(believed.choices), None)
    result, doubt, stand = doubted(kept, found.learn, found.judge, found.chosen_by)
    first = result.nameless.chosen.fit if result.nameless is not None else result.final
    opinion = found.opinion
    if opinion is not None and believed_instead(
        opinion, found.errors(first.model), lambda: coloured(first, found.learn, found.judge)
    ):
        result, doubt = as_result(opinion, result, found.learn, found.errors)
        return result, doubt, Stand(stand.before, stand.after, {})
    if opinion is not None and doubt is None and (short := inadequate(result, opinion)) is not None:
        kept_before = result.choices[: result.choices.index(short.choice)] if short.choice else ()
        final = kept_before[-1].chosen.fit if kept_before else result.baseline
        result = replace(result, choices=kept_before, final=final, last_round=())
        doubt = None if kept_before else short
    if doubt is None and (far := beyond_reach(result, found.given)) is not None:
        bare = replace(result, choices=(), final=result.baseline, last_round=())
        return bare, far, Stand(stand.before, stand.before, {})
    if harmful is not None and (doubt is None or doubt.choice is None):
        doubt = runs_away(harmful)
    if doubt is None and not result.choices:
        fits = found.course.simulate(result.baseline.model)[found.count :]
        doubt = off_the_mark(mean_percent(fits)) or slipped(data)
    return result, doubt, stand


def alarm(model: Model, estimation: list[DataSet], validation: list[DataSet]) -> tuple[SearchResult, bool]:
    """What the search finds, and whether the diagnosis would name or doubt anything: for `nulls`."""
    found = explain(model, estimation, validation, lambda text: None)
    result, doubt, _ = questioned(found, found.result, found.kept, [*estimation, *validation])
    return found.result, bool(result.choices) or doubt is not None


def diagnose(
    model: Model,
    estimation: list[DataSet],
    validation: list[DataSet],
    say=lambda text: None,
    null_count: int = 0,
    test: Sequence[DataSet] = (),
) -> tuple[SearchResult, Verdict, Proof, dict[str, Any]]:
    """Search, decide and prove; the last part is the content of diagnosis.json without run time and
    version.  With ``null_count`` the same is done with that many simulated sets of recordings in which
    nothing is hidden, and a finding has to exceed what is found there. ``test``: recordings that only show;
    without them a part of a long validation does (see `three_uses`).
    """
    refuse_unusable([*estimation, *validation, *test])
    uses = three_uses(estimation, validation, test)
    estimation, validation = [*uses.fit], [*uses.choose]
    found = explain(model, estimation, validation, say)
    chance: list[Null] = []
    dropped: tuple[Choice, ...] = ()
    believed, kept = found.result, found.kept
    if null_count:
        chance = nulls(alarm, model, found.result, estimation, validation, null_count, progress=say)
        believed = beyond_chance(found.result, chance)
        if not found.freely:  # what only a simulation found has no score that chance could be held against
            kept = beyond_chance(found.kept, chance)
            dropped = found.kept.choices[len(kept.choices) :]
    say("doubting")
    result, doubt, stand = questioned(found, believed, kept, [*estimation, *validation])
    adequate = None
    if any(c.chosen.by_current <= 0.0 for c in result.choices):
        models = result.baseline.model, result.final.model
        adequate = adequacy(
            result.baseline, result.final, [*found.learn, *found.judge], *map(found.errors, models)
        )
        result, short = short_of(result, adequate)
        result, bent = follows_still(result, found.learn, found.judge)
        doubt = doubt or short or bent
    say("deciding")
    verdict = decide_verdict(result, found.learn, found.judge, doubt, stand.spread, adequate)
    mapped = instead = None
    if verdict.kind == "unknown":
        mapped = measured_map(result.final, found.given, found.learn, found.judge, found.errors, say)
        if mapped.fit is None:
            instead = stand_in(result.final, found.given, doubt, found.errors)
        nameless = mapped.fit if instead is None else instead.fit
        result = replace(result, final=nameless or result.final)
    say("simulating all three models on all recordings")
    proof = prove(model, result.baseline.model, result.final.model, found.course, uses)
    columns = three_columns(model, result, verdict, found.judge)
    if instead is not None or (mapped is not None and mapped.fit is not None):
        errors = errors_of(result.final, found.judge)
        columns["augmented"] = column(result.final.model, model, result.final, errors)
    verdict = replace(verdict, findings=with_bounds(verdict.findings, columns["augmented"]))
    say("choosing the next experiment")
    content = contents(result, verdict, proof, columns, stand, doubt, (chance, dropped), uses, found.learn)
    believed = [c.chosen for c in (*result.choices, *([doubt.choice] if doubt and doubt.choice else []))]
    from_here = any(e.witnessed is not None for e in believed)
    content[MEASURED.name] = None if mapped is None else mapped.content()
    content["stand_in"] = None if instead is None else instead.content()
    content["inverse_dynamics"] = testimony(found.opinion, verdict, from_here) if found.opinion else None
    return result, verdict, proof, content
