"""One diagnosis from data sets to verdict: the order of its steps and nothing else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from haptic_teleop_sim.effects import MEASURED
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet

from .decision.adequacy import following, short_of
from .decision.at_reversals import where_torque_jumps, with_friction
from .decision.at_the_actuator import at_the_actuator, drawn_over_the_input
from .decision.beside_unknown import with_names
from .decision.decide import Choice
from .decision.drive_friction import with_drive_friction
from .decision.finding import unsure_of_their_shape
from .decision.freely_fitted import re_estimated
from .decision.late_input import with_lateness
from .decision.measured_input import of_measured_input
from .decision.misplaced import at_its_place, at_the_map, beside_findings, misplaced
from .decision.nulls import Null, beyond_chance, nulls
from .decision.outdone import outdone
from .decision.own_quantity import follows_still, one_curve
from .decision.read_wrong import read_wrong
from .decision.reasons import Doubt
from .decision.search import SearchResult
from .decision.stand import Stand, colours
from .decision.stand_in import stand_in
from .decision.unconfirmed import unconfirmed
from .decision.verdict import Verdict, decide_verdict
from .decision.with_the_named import not_in, with_the_named
from .evidence.acting_place import ActingPlace
from .evidence.lateness import is_lateness
from .evidence.measured_map import A_GOOD_TORQUE, MeasuredMap, measured_map, no_torque
from .evidence.other_forms import spread_by_form, together
from .evidence.proof import Proof, prove
from .evidence.steadiness import spread_by_stretch
from .explain import Explained
from .input_times import explained
from .inputs.between_samples import as_read
from .inputs.uses import three_uses
from .late_recordings import explained_on_time
from .question import lawful, questioned, steady, weighed
from .report.columns import column, errors_of, three_columns, with_bounds
from .report.contents import contents
from .report.next_experiment import once_calibrated
from .report.testimony import testimony
from .usable import refuse_unusable


def alarm(model: Model, estimation: list[DataSet], validation: list[DataSet]) -> tuple[SearchResult, bool]:
    """What the search finds, and whether the diagnosis would name or doubt anything: for `nulls`."""
    found, _ = explained(model, estimation, validation, lambda text: None)
    result, doubt, _ = questioned(found, found.result, found.kept, [*estimation, *validation])
    return found.result, bool(result.choices) or doubt is not None


def believed(
    found: Explained, chance: Sequence[Null], data: list[DataSet]
) -> tuple[SearchResult, Doubt | None, Stand, tuple[Choice, ...]]:
    """What is left of the findings after chance and `questioned`, and what fell by chance."""
    if not chance:
        return *questioned(found, found.result, found.kept, data), ()
    beyond, kept = beyond_chance(found.result, chance), found.kept
    dropped: tuple[Choice, ...] = ()
    if not found.freely:  # what only a simulation found has no score that chance could be held against
        kept = beyond_chance(found.kept, chance)
        dropped = found.kept.choices[len(kept.choices) :]
    return *questioned(found, beyond, kept, data), dropped


def drawn_beside(
    found: Explained, result: SearchResult, say: Callable[[str], None], least: float = A_GOOD_TORQUE
) -> MeasuredMap:
    """The map of what a result leaves; ``least``: see `measured_map`."""
    base, given, parts = result.final, found.given, (found.learn, found.judge)
    return measured_map(base, given, *parts, found.errors, say, found.cutoff, found.resized, least)


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
    refuse_unusable(estimation, validation, test)
    uses = three_uses(estimation, validation, test)
    found, read = explained(model, [*uses.fit], [*uses.choose], say)
    uses = uses.changed(as_read) if read else uses
    estimation, validation = [*uses.fit], [*uses.choose]
    chance: list[Null] = []
    if null_count:
        chance = nulls(alarm, model, found.result, estimation, validation, null_count, progress=say)
    say("checking what was found")
    result, doubt, stand, dropped = believed(found, chance, [*estimation, *validation])
    timely = None
    if result.choices or doubt is not None:
        timely = explained_on_time(model, (estimation, validation), found, result.choices, say)
    if timely is not None:
        on_its_time = uses.changed(timely.moved)
        sets = [*on_its_time.fit], [*on_its_time.choose]
        again = believed(timely.explained, chance, [*sets[0], *sets[1]])
        if any(is_lateness(c.chosen.effect.entry) for c in again[0].choices):
            timely = None
        else:
            found, (estimation, validation) = timely.explained, sets
            result, doubt, stand, dropped = again
    result = of_measured_input(unconfirmed(result, found.nearby), read, estimation)
    # The given model: a re-estimated one has made up for what is missing.
    acting = ActingPlace.of(model, [*found.learn, *found.judge], found.cutoff)
    away = None
    if acting is not None:
        result, away = misplaced(result, acting, found.learn)
        doubt = away or doubt
    result, bent = one_curve(result)
    doubt = bent or doubt
    result, wrong, followed = lawful(found, result)
    doubt = doubt or wrong
    adequate = None
    if any(c.chosen.by_current <= 0.0 for c in result.choices):
        result, adequate, varying = weighed(found, result, stand)
        doubt = doubt or varying
    adequate = following(adequate, followed)
    if adequate is not None and acting is not None:
        adequate = replace(adequate, parity=acting.explained([c.chosen.effect for c in result.choices]))
    if adequate is not None:
        result, short = short_of(result, adequate)
        result, bent = follows_still(result, found.learn, found.judge)
        drawn = lambda one, least: drawn_beside(found, one, say, least)  # noqa: E731
        result, curved = outdone(result, found.errors, drawn)
        doubt = curved or doubt or short or bent
    say("deciding")
    result = result.without_companions()
    forms = together(
        spread_by_form(result.final.model, found.learn, found.cutoff),
        spread_by_stretch(steady(found, result), result.final.model),
    )
    spread = together(stand.spread, forms)
    result = replace(result, choices=unsure_of_their_shape(result.choices, result.final, spread))
    verdict = decide_verdict(result, found.learn, found.judge, doubt, spread, adequate)
    turning = where_torque_jumps(result.baseline, found.learn, found.judge, found.inertias)
    mapped = instead = misread = None
    predicted, kinds = result, (found.learn, found.judge)
    if verdict.kind == "unknown":
        # Before a map, which is held against it.
        result = re_estimated(result, found.given, found.resized, found.errors)
    named = result.final
    if verdict.kind == "unknown":
        mapped = drawn_beside(found, result, say)
        if mapped.fit is None:
            instead = stand_in(result.final, found.given, doubt, found.errors)
        verdict = with_names(
            verdict,
            predicted,
            doubt,
            instead,
            found.opinion,
            found.learn,
            lambda model: together(stand.spread, spread_by_form(model, found.learn, found.cutoff)),
            turning,
        )
        nameless = mapped.fit if instead is None else instead.fit
        result = replace(result, final=nameless or result.final)
    if acting is not None and verdict.kind != "no_mismatch":
        verdict = with_drive_friction(verdict, acting, kinds, predicted.baseline, turning)
    verdict = with_friction(verdict, turning, predicted, found.learn)
    if acting is not None and verdict.kind != "no_mismatch":
        acting = beside_findings(verdict, acting)
        # What acts now and then, or follows the input in detail, is little beside the noise of equations.
        if doubt is None or doubt.place is None:
            # What was refuted at its own place says nothing for that.
            given_up = doubt.choice.chosen.effect if doubt and doubt is not away and doubt.choice else None
            verdict, misread = at_its_place(verdict, acting, given_up)
    verdict, wrong = read_wrong(verdict, predicted.baseline, kinds, found.cutoff, found.course, found.count)
    if wrong is not None:
        misread = wrong.error.location
    if misread is not None:
        mapped, instead = no_torque(misread, wrong and wrong.error), None
        result = replace(result, final=named)
    beside = None
    if verdict.kind == "unknown":
        no_map = mapped if misread is not None else None
        draw = lambda fit: no_map or drawn_beside(found, replace(result, final=fit), say)  # noqa: E731
        parts = found.given, found.learn, found.errors, found.resized
        beside = with_the_named(verdict, named, result.final, *parts, draw)
        if beside is not None:
            mapped, instead, result = beside.mapped, None, replace(result, final=beside.fit)
    of_input = None
    # A torque that is drawn over the motion is the motion's, and one over the input the actuator's.
    if misread is None and mapped is not None and mapped.fit is not None:
        if doubt is None or doubt.place is None:
            verdict = at_the_map(verdict, mapped, acting)
        verdict = drawn_over_the_input(verdict, mapped, predicted.baseline)
    elif misread is None:
        verdict, of_input = at_the_actuator(verdict, predicted.baseline, *kinds)
    stands_in = result.final is not named
    if timely is not None:
        found = timely.as_recorded
        verdict, result = with_lateness(timely.late, verdict, result, found.result.baseline)
        stand = replace(stand, before=colours(result.baseline, found.learn, found.judge))
    result = re_estimated(result, found.given, found.resized, found.errors)
    if result.baseline is not predicted.baseline:
        stand = replace(stand, before=colours(result.baseline, found.learn, found.judge))
    say("simulating all three models on all recordings")
    proof = prove(model, result.baseline.model, result.final.model, found.course, uses)
    columns = three_columns(model, result, verdict, found.judge, forms)
    if stands_in:
        errors = together(
            errors_of(result.final, found.judge),
            spread_by_form(result.final.model, found.learn, found.cutoff),
        )
        columns["augmented"] = column(result.final.model, model, result.final, errors)
    verdict = replace(verdict, findings=with_bounds(verdict.findings, columns["augmented"]))
    say("choosing the next experiment")
    added = "what was found"
    if instead is not None:
        named_too = instead.named(verdict.findings)
        added = "what is named, as it simulates best" if named_too else "a stand-in that is not believed"
    elif mapped is not None and mapped.fit is not None:
        added = "a measured torque in place of a name"
        if beside is not None or result.choices:
            added = "what was found, and a measured torque for the rest"
    missing = not_in(verdict, result.final.model)
    if missing:
        added += f", but without {' and '.join(f'{e.effect} at {e.location}' for e in missing)}"
    stand = replace(stand, after=colours(result.final, found.learn, found.judge))
    told = (chance, dropped), uses, found.learn, added
    content = contents(result, verdict, proof, columns, stand, doubt, *told)
    told_of = [c.chosen for c in (*result.choices, *([doubt.choice] if doubt and doubt.choice else []))]
    from_here = any(e.witnessed is not None for e in told_of)
    content[MEASURED.name] = None if mapped is None else mapped.content()
    told = acting is not None and verdict.kind != "no_mismatch"
    content["parity"] = acting.content(verdict.kind == "unknown") if acting and told else None
    content["in_proportion"] = of_input and {name: round(gain, 1) for name, gain in of_input.items()}
    content["reading_error"] = None
    if wrong is not None:
        content["reading_error"] = wrong.content()
        content["next_experiment"] = once_calibrated(wrong.error.location)
    content["stand_in"] = None if instead is None else instead.content(verdict.findings)
    content["reversals"] = [one.content() for one in turning.jumps]
    opinion = found.opinion if timely is None else timely.explained.opinion
    content["inverse_dynamics"] = testimony(opinion, verdict, from_here) if opinion else None
    return result, verdict, proof, content
