"""One diagnosis from data sets to verdict: baseline, search, second opinion, chance, doubt, proof."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.dataset import DataSet
from haptic_teleop_sysid.estimation.records import Record, records_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

from .columns import three_columns, with_bounds
from .contents import contents
from .current import shown_by_current
from .decide import Choice
from .doubt import doubted
from .nulls import Null, beyond_chance, nulls
from .plausible import refuse_copies, refuse_idle
from .proof import Course, Proof, mean_percent, prove
from .reasons import off_the_mark, runs_away, slipped
from .scales import within_reach
from .search import LEAST_PERCENT, POOR_FIT, SearchResult, search, search_by_simulation
from .uses import FEWEST_SAMPLES, three_uses
from .verdict import Verdict, decide_verdict

#: Difference (A or N·m, relative to the rms command) up to which the measured current counts as following.
_FOLLOWS = 0.1
#: Loss of the simulated fit on validation recordings, percent, from which a finding is not believed.
HARM = 2.0


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
        for values, what in ((longest.input, "input"), (longest.measured[:, 0], "motor angle")):
            if float(np.nanstd(values)) < 1e-9:
                raise RecordingError(
                    f"{dataset.name}: the {what} of {dataset.joint} does not change, so there is nothing to "
                    "diagnose: record while this joint is driven, or give the model of the one that was."
                )
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


def diagnose(
    model: Model,
    estimation: list[DataSet],
    validation: list[DataSet],
    say=lambda text: None,
    null_count: int = 0,
    test: Sequence[DataSet] = (),
) -> tuple[SearchResult, Verdict, Proof, dict[str, Any]]:
    """Search, decide and prove; the last part is the content of diagnosis.json without run time and
    version.  With ``null_count`` the search is repeated on that many simulated sets of recordings in which
    nothing is hidden, and a finding has to exceed what it finds there. ``test``: recordings that only show;
    without them a part of a long validation does (see `three_uses`).
    """
    for part in (estimation, validation, test):
        records_of([*part])  # refused where unusable
    refuse_copies([*estimation, *validation, *test])
    refuse_idle([*estimation, *validation, *test])
    uses = three_uses(estimation, validation, test)
    estimation, validation = [*uses.fit], [*uses.choose]
    learn, judge = records_of(estimation), records_of(validation)
    n, everything = len(estimation), [*estimation, *validation]
    say("re-estimating the given structure")
    baseline = fit_from_scratch(model, learn, limits=within_reach(model))
    course = Course.of(baseline.model, everything)
    result = search(
        model,
        baseline,
        learn,
        judge,
        sense_follows=sense_follows(estimation),
        shown=shown_by_current(model, estimation, validation),
        percent=lambda candidate: float(np.mean(course.percent(candidate))),
        progress=say,
    )

    def percent(candidate: Model) -> tuple[float, float]:
        fits = course.percent(candidate, "position")
        return float(np.mean(fits[:n])), float(np.mean(fits[n:]))

    kept = unharmful(result, lambda candidate: float(np.mean(course.percent(candidate)[n:])))
    found_freely = False
    poor = min(percent(kept.final.model)) < POOR_FIT or (result.choices and not kept.choices)
    if poor and result.nameless is None:
        say("searching by free simulation")
        free = search_by_simulation(model, result.baseline, learn, judge, percent=percent, progress=say)
        gained = sum(percent(free.final.model)) - sum(percent(kept.final.model))
        if free.choices and (not kept.choices or gained > LEAST_PERCENT):
            kept, found_freely = free, True
    chance: list[Null] = []
    dropped: tuple[Choice, ...] = ()
    if null_count:
        follows = sense_follows(estimation)
        chance = nulls(model, result, learn, judge, null_count, sense_follows=follows, progress=say)
        # What only a simulation found has no score in nats that chance could be held against.
        believed = beyond_chance(kept, chance) if not found_freely else kept
        dropped, kept = kept.choices[len(believed.choices) :], believed
    say("doubting")
    believed = beyond_chance(result, chance) if null_count else result
    harmful = None if kept.choices else next(iter(believed.choices), None)
    result, doubt, stand = doubted(
        kept, learn, judge, lambda candidate: float(np.mean(course.percent(candidate)[n:]))
    )
    if harmful is not None and (doubt is None or doubt.choice is None):
        doubt = runs_away(harmful)
    if doubt is None and not result.choices:
        doubt = off_the_mark(mean_percent(course.simulate(result.baseline.model)[n:])) or slipped(everything)
    say("deciding")
    verdict = decide_verdict(result, learn, judge, doubt, stand.spread)
    say("simulating all three models on all recordings")
    proof = prove(model, result.baseline.model, result.final.model, course, uses)
    columns = three_columns(model, result, verdict, judge)
    verdict = replace(verdict, findings=with_bounds(verdict.findings, columns["augmented"]))
    say("choosing the next experiment")
    content = contents(result, verdict, proof, columns, stand, doubt, (chance, dropped), uses, learn)
    return result, verdict, proof, content
