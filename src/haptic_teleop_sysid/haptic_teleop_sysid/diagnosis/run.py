"""One diagnosis from data sets to verdict: the order of its steps, and what is put together from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.recordings.dataset import DataSet

from .answered import Answered, answered
from .believed import Believed, Say, believed
from .decision.name_tests.late_input import with_lateness
from .decision.reasons import Doubt
from .decision.search.freely_fitted import re_estimated
from .decision.search.rounds import SearchResult
from .decision.stand import Stand, colours
from .decision.unknown.simulating_model import not_in
from .decision.verdict import Verdict
from .evidence.other_forms import spread_by_form, together
from .evidence.proof import Proof, prove
from .examined import examined
from .explain import Explained
from .inputs.uses import Uses, three_uses
from .nearly_all import nearly_all
from .report.columns import column, errors_of, three_columns, with_bounds
from .report.contents import contents
from .report.inverse_dynamics import inverse_dynamics_content
from .report.next_experiment import once_calibrated
from .report.summary import settled_sentence
from .usable import refuse_unusable


def diagnose(
    model: Model,
    estimation: list[DataSet],
    validation: list[DataSet],
    say: Say = lambda text: None,
    null_count: int = 0,
    test: Sequence[DataSet] = (),
) -> tuple[SearchResult, Verdict, Proof, dict[str, Any]]:
    """Search, decide and prove; the last part is the content of diagnosis.json without run time and
    version.  With ``null_count`` the same is done with that many simulated sets of recordings in which
    nothing is hidden, and a finding has to exceed what is found there. ``test``: recordings that only show;
    without them a part of a long validation does (see `three_uses`).
    """
    refuse_unusable(estimation, validation, test)
    belief = believed(model, three_uses(estimation, validation, test), say, null_count)
    left = nearly_all(belief, examined(model, belief, say))
    say("deciding")
    answer = answered(belief, left, say)
    added_to = answer.stands_in
    found, answer, stand = _as_recorded(belief, answer, left.result.baseline)
    result = answer.result
    say("simulating all three models on all recordings")
    proof = prove(model, result.baseline.model, result.final.model, found.course, belief.uses)
    columns = three_columns(model, result, answer.verdict, found.judge, left.forms)
    if added_to:
        form = spread_by_form(result.final.model, found.learn, found.cutoff)
        errors = together(errors_of(result.final, found.judge), form)
        columns["augmented"] = column(result.final.model, model, result.final, errors)
    findings = with_bounds(answer.verdict.findings, columns["augmented"])
    answer = replace(answer, verdict=replace(answer.verdict, findings=findings))
    say("choosing the next experiment")
    stand = replace(stand, after=colours(result.final, found.learn, found.judge))
    told = (belief.chance, belief.dropped), _told(belief.uses, result), found.learn, _has(answer)
    content = contents(result, answer.verdict, proof, columns, stand, left.doubt, *told)
    return result, answer.verdict, proof, content | _further(belief, answer, left.doubt)


def _as_recorded(belief: Believed, answer: Answered, predicted: Fit) -> tuple[Explained, Answered, Stand]:
    """What was found in recordings as they came, with the lateness of their input where they were moved in
    time, and the structure as it simulates best; ``predicted``: the structure as it predicts best."""
    found, stand = belief.found, belief.stand
    if belief.timely is not None:
        found = belief.timely.as_recorded
        late, baseline = belief.timely.late, found.result.baseline
        verdict, result = with_lateness(late, answer.verdict, answer.result, baseline)
        answer = replace(answer, verdict=verdict, result=result)
    result = re_estimated(answer.result, found.given, found.resized, found.errors)
    if result.baseline is not predicted:
        stand = replace(stand, before=colours(result.baseline, found.learn, found.judge))
    return found, replace(answer, result=result), stand


def _told(uses: Uses, result: SearchResult) -> Uses:
    """The uses of the recordings, in words of what was found, too."""
    if not result.settled:
        return uses
    return replace(uses, told=f"{uses.told}. {settled_sentence(result.settled)}")


def _has(answer: Answered) -> str:
    """What the augmented model has, and what it lacks, in words."""
    missing = not_in(answer.verdict, answer.result.final.model)
    if not missing:
        return answer.added
    lacks = " and ".join(f"{e.effect} at {e.location}" for e in missing)
    return f"{answer.added}, but without {lacks}"


def _further(belief: Believed, answer: Answered, doubt: Doubt | None) -> dict[str, Any]:
    """Of the content of diagnosis.json what is said of physics without a name, and by the other methods."""
    verdict, wrong = answer.verdict, answer.wrong
    given_up = [doubt.choice] if doubt is not None and doubt.choice is not None else []
    from_here = any(c.chosen.grounds is not None for c in (*answer.result.choices, *given_up))
    told = answer.acting is not None and verdict.kind != "no_mismatch"
    gains, second_method = answer.of_input, belief.found.second_method
    further = {
        "settled_by_both": list(answer.result.settled),
        MEASURED.name: None if answer.mapped is None else answer.mapped.content(),
        "parity": answer.acting.content(answer.unknown) if answer.acting and told else None,
        "in_proportion": gains and {name: round(gain, 1) for name, gain in gains.items()},
        "reading_error": None if wrong is None else wrong.content(),
        "stand_in": None if answer.instead is None else answer.instead.content(verdict.findings),
        "reversals": [one.content() for one in answer.turning.jumps],
        "inverse_dynamics": inverse_dynamics_content(second_method, verdict, from_here)
        if second_method
        else None,
    }
    if wrong is not None:
        further["next_experiment"] = once_calibrated(wrong.error.location)
    return further
