"""When inverse dynamics and free runs are believed over one-step prediction, and what they then say."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from stepped_machines import DT, RIGID, drive, pendulum, record, swing

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect, load_model
from haptic_teleop_sysid.commands.diagnose import main
from haptic_teleop_sysid.diagnosis.decision.finding import (
    finding,
    shape_unknown,
    size_known,
    unsure_of_their_shape,
)
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.second_method.as_result import as_result
from haptic_teleop_sysid.diagnosis.decision.second_method.free_run_sizes import sized_freely
from haptic_teleop_sysid.diagnosis.decision.second_method.overruled import (
    believed_instead,
    beyond_reach,
    more_plainly,
    stands_next,
)
from haptic_teleop_sysid.diagnosis.decision.second_method.torques_explained import (
    explained_in_band,
    inadequate,
    recovered,
)
from haptic_teleop_sysid.diagnosis.decision.verdict import decide_verdict
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.searched_groups import Group
from haptic_teleop_sysid.diagnosis.evidence.second_method import (
    JudgedGroup,
    fitted_to_both,
    judge_groups,
    plainer_first,
)
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.hypotheses.material import material
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.report.summary import settled_sentence
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts
from haptic_teleop_sysid.simulation.parameter_fit import ParameterFit


@pytest.fixture(scope="module")
def rubbing():
    """Recordings of a pendulum with dry friction, what the inverse dynamics say of them, and a first method
    that found nothing."""
    learn, judge = ([pendulum(seed, coulomb=0.4)] for seed in (0, 1))
    scales = recording_scales(RIGID, learn)
    baseline = fit_whole(RIGID, noise_starts(RIGID, learn)[1], learn, iterations=5)
    return learn, judge, scales, SearchResult(baseline, baseline, (), (), scales)


def errors_of(model):
    """Free runs that err by a tenth with friction of about the right size, and by a half without."""
    torque = sum(e.parameters.get("torque", 0.0) for e in model.effects if "friction" in e.effect)
    return (0.1, 0.12) if abs(torque - 0.4) < 0.1 else (0.5, 0.5)


def as_it_is(model):
    """A fit to free runs that finds nothing better."""
    return ParameterFit(model, True, (1.0, 1.0), 1)


@pytest.fixture(scope="module")
def second_method(rubbing):
    """What the inverse dynamics say where free runs with friction err far less."""
    learn, judge, scales, _ = rubbing
    return judge_groups(search_groups(RIGID, learn, judge, scales), scales, errors_of, (0.5, 0.5))


FRICTION = "j_motor.coulomb_friction.torque"


@pytest.mark.parametrize("ramp", [True, False])
def test_what_the_estimation_recordings_leave_open_the_others_settle(ramp):
    """A slow ramp says hardly anything of the inertia: runs of a step with that say nothing of the name."""
    time = DT * np.arange(10000)
    kinds = []
    for torque in (0.5 + 0.1 * time if ramp else drive(0, 2.0), np.where(time % 4.0 < 2.0, 1.5, 0.0)):
        angles = swing(torque, 0.14, 0.35, 0.4, 0.0, 0.0, 0.0, 0.0)
        kinds.append([record(torque, angles[:, None], 1e-2)])
    said = search_groups(RIGID, *kinds, recording_scales(RIGID, kinds[0]))
    group = next(g for g in said.levels[0] if g.effects[0].effect == "coulomb_friction")
    found = said.settling(group)
    assert (found is not None) == ramp
    if found is not None:
        assert found.settled == ("motor_inertia",)
        assert found.model.parameters["motor_inertia"] == pytest.approx(0.14, rel=0.1)
        assert found.effects[0].parameters["torque"] == pytest.approx(0.4, rel=0.1)
        step = lambda model: (0.1, abs(model.parameters["motor_inertia"] - 0.14))  # noqa: E731
        assert fitted_to_both(said, group, step) == found
        assert fitted_to_both(said, group, lambda model: (0.1, 0.1)) == group


def ending_at(torque):
    """A fit to free runs that ends with this friction, N·m, sure within 0.01 of all parameters."""

    def fit(model):
        other = model.with_values({FRICTION: torque})
        return ParameterFit(other, True, (1.0, 0.5), 9, std=dict.fromkeys(model.free_parameters(), 0.01))

    return fit


def test_sizes_that_free_runs_want_are_taken_where_they_simulate_other_recordings_better(second_method):
    found = second_method.chosen
    before = found.group.model.parameter_values()[FRICTION]
    larger = ending_at(before + 0.2)
    taken = sized_freely(found, larger, lambda model: (0.1, 0.05), 1.0)
    assert taken.errors == (0.1, 0.05)
    assert taken.group.model.parameter_values()[FRICTION] == before + 0.2
    # What the two ways of fitting differ by is part of the standard error: 0.2 apart are +- 0.14 for each.
    assert taken.group.std[FRICTION] == pytest.approx(math.hypot(0.01, 0.2 / math.sqrt(2.0)))
    for errors in ((0.1, 0.115), (0.2, 0.05)):  # no better on the others; worse where it was fitted
        assert sized_freely(found, larger, lambda model, e=errors: e, 1.0) is found
    fled = replace(as_it_is(found.group.model), fled=("motor_inertia",))
    assert sized_freely(found, lambda model: fled, lambda model: (0.01, 0.01), 1.0) is found


def test_what_gains_by_inverse_dynamics_and_by_free_runs_becomes_the_result(rubbing):
    learn, judge, scales, first = rubbing
    second_method = judge_groups(search_groups(RIGID, learn, judge, scales), scales, errors_of, (0.5, 0.5))
    assert [e.effect for e in second_method.chosen.group.effects] == ["coulomb_friction"]
    assert believed_instead(second_method, [], (0.5, 0.5), coloured=lambda: True)
    result, doubt = as_result(second_method, first, learn, errors_of, as_it_is)
    assert doubt is None and not result.settled
    both = replace(second_method.chosen.group, settled=("motor_inertia",))
    told = as_result(
        replace(second_method, chosen=replace(second_method.chosen, group=both)),
        first,
        learn,
        errors_of,
        as_it_is,
    )[0]
    assert told.settled == ("motor_inertia",)
    assert "motor inertia open" in settled_sentence(told.settled)
    verdict = decide_verdict(result, learn, judge, doubt)
    assert verdict.kind == "identified"
    (finding,) = verdict.findings
    assert (finding["effect"], finding["location"]) == ("coulomb_friction", "j_motor")
    torque = finding["parameters"]["torque"]
    assert torque["value"] == pytest.approx(0.4, abs=3 * torque["std"])
    assert 0.0 < torque["std"] < 0.1
    assert "free run" in finding["because"]
    # The torque that it explains is that in the band of the motion, too, whatever an observer corrects.
    explained = explained_in_band(result, second_method)
    assert explained == pytest.approx(second_method.chosen.group.explained, abs=0.02)
    assert explained > 0.9
    predicted = replace(result.choices[0], chosen=replace(result.choices[0].chosen, grounds=None))
    assert explained_in_band(replace(result, choices=(predicted,)), second_method) == 0.0
    # No torque recovers more than the right one; of a part of it any form recovers more.
    assert recovered(result, second_method) > 0.95
    more = replace(second_method, searched=replace(second_method.searched, recoverable=2.0 * explained))
    assert recovered(result, more) == pytest.approx(0.5)
    assert recovered(replace(result, choices=(predicted,)), more) == 1.0, "other methods have other sizes"


def test_free_runs_that_are_no_better_than_the_mean_say_nothing_for_a_name(rubbing):
    learn, judge, scales, _ = rubbing
    said = search_groups(RIGID, learn, judge, scales)
    for error, believed in ((0.9, True), (1.1, False)):
        runs = judge_groups(said, scales, lambda _, e=error: (e, 0.5), (2.0, 2.0))
        assert (runs.chosen is not None) == believed


def test_a_limit_that_leaves_nothing_of_the_input_is_no_saturation(rubbing):
    scales = rubbing[2]
    for share, named in ((0.1, False), (0.5, True)):
        limit = Effect("torque_saturation", "j_actuator", {"limit": share * scales.size["torque"]})
        assert material(limit, scales) == named


def test_a_first_method_that_runs_as_well_stays(second_method):
    assert not believed_instead(second_method, [], (0.1, 0.12), coloured=lambda: True)
    # White innovations are believed longer.
    assert believed_instead(second_method, [], (0.12, 0.14), coloured=lambda: True)
    assert not believed_instead(second_method, [], (0.12, 0.14), coloured=lambda: False)


def test_white_innovations_are_not_believed_against_the_torques_too(second_method):
    """Free runs err clearly less by the second method, if not far less, and the torques want it as well."""
    better, run = Effect("coulomb_friction", "j_motor", {"torque": 0.3}), (0.12, 0.14)
    ripple = Effect("torque_ripple", "j_motor", {"amplitude": 0.2, "order": 5.0, "phase": 0.0})
    delay = Effect("sensor_delay", "j_motor_encoder", {"delay": 0.01})

    def believed(*named, first=run):
        return believed_instead(second_method, named, first, coloured=lambda: False)

    assert believed(better), "the same name, another size"
    assert believed(ripple), "another name, of which the torques know nothing"
    assert not believed(ripple, first=(0.1, 0.12)), "free runs err no less"
    assert not believed(delay), "no torque: the torques cannot be asked"
    assert not believed(Effect("asymmetric_friction", "j_motor", {"positive": 0.4, "negative": 0.4}))
    assert not believed(), "where nothing was found, white innovations say that nothing is there"


def test_more_names_have_to_be_worth_more_torque_each(second_method):
    """The second method's one name against none that is there, as if it had been two and three."""
    ripple = Effect("torque_ripple", "j_motor", {"amplitude": 0.2, "order": 5.0, "phase": 0.0})
    gained = second_method.chosen.group.gain
    assert gained > 2 * 12.0
    for names, stands in ((2, True), (int(gained / 12.0) + 3, False)):
        group = second_method.chosen.group
        group = SimpleNamespace(effects=group.effects * names, hypotheses=group.hypotheses * names)
        folds = SimpleNamespace(model=RIGID, likelier=lambda terms: gained if len(terms) > 1 else 0.0)
        told = replace(second_method, chosen=replace(second_method.chosen, group=group))
        told = replace(told, searched=replace(second_method.searched, folds=folds))
        assert believed_instead(told, [ripple], (0.12, 0.14), coloured=lambda: False) == stands


def test_what_errs_far_less_where_neither_was_fitted_is_believed_over_a_close_fit(second_method):
    """A first method of many parameters may simulate better what it was fitted to, all else far worse."""
    assert believed_instead(second_method, [], (0.07, 0.25), coloured=lambda: False)
    assert not believed_instead(second_method, [], (0.07, 0.22), coloured=lambda: False)


def test_a_name_that_is_given_up_brings_up_the_next_where_that_explains_most(second_method):
    assert second_method.explains_most
    assert stands_next(second_method, second_method.chosen.errors)
    assert not stands_next(second_method, (0.09, 0.12))  # worse than nothing where it was fitted
    assert not stands_next(second_method, (0.1, 0.11))
    more = replace(
        second_method,
        searched=replace(second_method.searched, recoverable=2.0 * second_method.searched.recoverable),
    )
    assert not stands_next(more, second_method.chosen.errors)  # half of what could be explained is not
    assert not stands_next(replace(second_method, chosen=None), (0.5, 0.5))


def test_sizes_that_free_runs_shrink_by_far_are_those_of_something_else(second_method):
    found = second_method.chosen
    before = found.group.model.parameter_values()[FRICTION]
    for factor, taken in ((0.3, False), (0.6, True), (1.9, True), (3.0, False)):
        fitted = ending_at(factor * before)
        assert (sized_freely(found, fitted, lambda model: (0.1, 0.05), 1.0) is not found) == taken


def test_what_spoils_the_free_run_is_not_believed_however_much_torque_it_explains(rubbing):
    learn, judge, scales, _ = rubbing
    said = search_groups(RIGID, learn, judge, scales)
    spoilt = judge_groups(said, scales, lambda m: (0.4, 0.6) if m.effects else (0.5, 0.5), (0.5, 0.5))
    assert spoilt.chosen is None
    assert not believed_instead(spoilt, [], (0.9, 0.9), coloured=lambda: True)


def test_a_name_that_explains_little_of_what_its_quantities_do_is_given_up():
    model = RIGID.with_effects(Effect("gravity", "j_motor", {"torque": 4.0}))
    # Viscous friction that grows and falls with the angle: no effect has this form.
    learn, judge = ([pendulum(seed, weight=4.0, swirl=0.3)] for seed in (0, 1))
    scales = recording_scales(model, learn)
    second_method = judge_groups(
        search_groups(model, learn, judge, scales), scales, lambda m: (0.5, 0.5), (0.5, 0.5)
    )
    baseline = fit_whole(model, noise_starts(model, learn)[1], learn, iterations=5)
    named = fit_whole(
        model.with_effects(Effect("coulomb_friction", "j_motor", {"torque": 0.02})),
        baseline.noise,
        learn,
        free=(),
        iterations=3,
    )
    choice = Choice(Explanation(named, 50.0, 20.0, True, 1), 1.0)
    result = SearchResult(baseline, named, (choice,), (), scales)
    doubt = inadequate(result, second_method, lambda m: (0.5, 0.5))
    assert doubt is not None and doubt.choice is choice
    assert "coulomb_friction explains" in doubt.why
    # A second method that simulates far worse with the same names knows the structure too badly to judge
    # them.
    assert inadequate(result, second_method, lambda m: (0.1, 0.1) if m is named.model else (0.5, 0.5)) is None


def test_a_name_that_needs_another_machine_is_given_up(rubbing):
    learn, _, scales, first = rubbing
    steep = np.full(len(first.baseline.free), 200.0)
    named = replace(first.baseline, at_bound=("motor_inertia",), gradient=steep)
    late = Effect("input_delay", "j_actuator", {})
    choice = Choice(Explanation(named, 50.0, 20.0, True, 0, beside=late), 1.0)
    result = replace(first, final=named, choices=(choice,))
    far = replace(named.model, parameters={**named.model.parameters, "motor_inertia": 1.0})
    doubt = beyond_reach(result, far)
    assert doubt is not None and "motor inertia" in doubt.why
    # One that the recordings do not want there is only badly known.
    weak = replace(named, gradient=np.full(len(named.free), 1e-3))
    assert beyond_reach(replace(result, final=weak), far) is None
    assert beyond_reach(replace(result, final=replace(named, at_bound=("motor_damping",))), far) is None


@pytest.mark.long
@pytest.mark.parametrize(
    ("machine", "named", "inertia"),
    [
        ("kr300", {"coulomb_friction": (250.0, 500.0)}, (1300.0, 2600.0)),
        ("dfki", {"gravity": (2.9, 3.6), "coulomb_friction": (0.15, 0.3)}, (0.12, 0.22)),
    ],
)
def test_real_machines_get_the_names_and_sizes_of_the_published_order(
    tmp_path, shared_data, machine, named, inertia
):
    folder = shared_data / "real" / machine
    arguments = ["--model", str(folder / "model.yaml"), "--estimation", str(folder / "estimation")]
    arguments += ["--validation", str(folder / "validation"), "--no-report"]
    arguments += ["--output", str(tmp_path / "out")]
    assert main(arguments) == 0
    said = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert said["verdict"] == "identified"
    assert {f["effect"] for f in said["findings"]} == set(named)
    for one in said["findings"]:
        low, high = named[one["effect"]]
        assert low < one["parameters"]["torque"]["value"] < high
    before, after = said["fit"]["baseline"]["validation"], said["fit"]["augmented"]["validation"]
    assert all(after[name] > before[name] + 5.0 for name in before)
    model = load_model(tmp_path / "out" / "augmented_model.yaml")
    assert inertia[0] < model.parameters["motor_inertia"] < inertia[1]


def test_nobody_is_surer_of_a_name_than_of_its_size():
    friction = Effect("coulomb_friction", "j_motor", {"torque": 11.9})
    unsure = size_known(friction, {"torque": {"value": 11.9, "std": 5.6}})
    assert 0.6 < unsure < 0.8
    assert size_known(friction, {"torque": {"value": 11.9, "std": 0.4}}) > 0.999
    # An arm whose angle hardly tells one order from the next has an inertia of any shape.
    folds = Effect("angle_dependent_inertia", "j_motor", {"amplitude": 0.132, "order": 3.06})
    told = {"amplitude": {"value": 0.132, "std": 0.028}, "order": {"value": 3.06, "std": 1.3}}
    assert size_known(folds, told) < 0.5
    assert size_known(folds, {**told, "order": {"value": 3.06, "std": 0.1}}) > 0.95
    # A limit is none where it is infinite: it is known as well as its inverse.
    limit = Effect("torque_speed_limit", "j_actuator", {"limit": 85.8, "slope": 252.0})
    told = {"limit": {"value": 85.8, "std": 116.0}, "slope": {"value": 252.0, "std": 343.0}}
    assert size_known(limit, told) < 0.5
    assert size_known(limit, {**told, "limit": {"value": 85.8, "std": 8.0}}) > 0.95


def heard_of(*names, gain, torques, errors=(0.1, 0.1)):
    hypotheses = tuple(SimpleNamespace(entry=EFFECTS[n], location="j_motor") for n in names)
    return JudgedGroup(Group(RIGID, hypotheses, torques, 90.0, 0.9, {}), gain, errors)


def test_a_richer_form_needs_more_than_chance_from_torques_or_free_runs():
    rich, plain = ("presliding_friction", "gravity"), ("coulomb_friction", "gravity")

    def first(*, torques=(30.0, 22.0), errors=(0.1, 0.1), plain=plain):
        one = heard_of(*rich, gain=40.0, torques=torques[0], errors=errors)
        found = plainer_first([one, heard_of(*plain, gain=32.0, torques=torques[1])])
        assert [h.gain for h in found] == [40.0, 32.0], "what is believed keeps what the best one gains"
        return [h.entry.name for h in found[0].group.hypotheses]

    assert first() == [*plain]
    assert first(torques=(40.0, 22.0)) == [*rich], "its shape gains from the torques"
    assert first(errors=(0.08, 0.09)) == [*rich], "free runs err less with it"
    assert first(plain=("coulomb_friction", "spring_to_ground")) == [*rich], "that is something else"
    assert first(plain=("asymmetric_friction", "gravity")) == [*rich], "that is no plainer form of it"


def found_by_prediction(baseline, *effects, std=None):
    """A result with these effects, each with these standard errors by parameter name."""
    fit = replace(baseline, model=RIGID.with_effects(*effects))
    choices = tuple(
        Choice(Explanation(fit, 50.0, 20.0, True, i, std=std or {}), 1.0) for i in range(len(effects))
    )
    return SearchResult(baseline, fit, choices, (), None)


def test_the_plainer_form_of_the_same_names_is_told_from_others(second_method, rubbing):
    baseline = rubbing[3].baseline
    falling = Effect("stribeck_friction", "j_motor", {"coulomb": 0.1, "breakaway": 0.4, "velocity": 2.0})
    plain = Effect("coulomb_friction", "j_motor", {"torque": 0.4})
    weight = Effect("gravity", "j_motor", {"torque": 1.0})
    assert [e.effect for e in second_method.chosen.group.effects] == ["coulomb_friction"]

    def plainly(*effects, of=second_method, errors=second_method.chosen.errors):
        return more_plainly(of, found_by_prediction(baseline, *effects), errors)

    assert plainly(falling)
    assert plainly(falling, errors=(0.095, 0.115))
    assert not plainly(falling, errors=(0.08, 0.12)), "the richer form runs better"
    assert not plainly(plain), "it is the same"
    assert not plainly(weight), "it is something else"
    assert not plainly(falling, weight), "it is more"
    group = replace(
        second_method.chosen.group, model=RIGID.with_effects(weight, plain), hypotheses=(None, None)
    )
    pair = replace(second_method, chosen=replace(second_method.chosen, group=group))
    assert plainly(falling, weight, of=pair), "two at one place are told apart by their names"
    assert not plainly(falling, of=pair)
    assert not plainly(falling, of=replace(second_method, chosen=None))
    more = replace(
        second_method,
        searched=replace(second_method.searched, recoverable=2.0 * second_method.searched.recoverable),
    )
    assert not plainly(falling, of=more), "half of what could be explained is not"


def test_a_friction_that_falls_nobody_knows_to_what_has_no_known_shape(rubbing):
    baseline, head = rubbing[3].baseline, "j_motor.stribeck_friction."
    falling = Effect("stribeck_friction", "j_motor", {"coulomb": 0.0, "breakaway": 0.4, "velocity": 5.6})
    known = {head + "coulomb": 0.05, head + "breakaway": 0.1, head + "velocity": 5.7}
    for std, unknown in ((known, False), ({**known, head + "coulomb": 1.25}, True)):
        result = found_by_prediction(baseline, falling, std=std)
        assert shape_unknown(result.choices[0], result.final, {}) == unknown
        (choice,) = unsure_of_their_shape(result.choices, result.final, {})
        assert ("no more than coulomb friction" in choice.unsure) == unknown
        told = finding(choice, result.final, {})
        assert (told["confidence"] <= 0.69) == unknown
    # The spread between recordings counts.
    result = found_by_prediction(baseline, falling, std=known)
    assert shape_unknown(result.choices[0], result.final, {head + "breakaway": 0.3})
    # A size at its bound has no error that anybody knows.
    ended = replace(result.final, at_bound=(head + "coulomb",))
    (choice,) = unsure_of_their_shape(result.choices, ended, {})
    assert "its coulomb ended at a bound" in choice.unsure
    assert finding(choice, ended, {})["confidence"] <= 0.69

