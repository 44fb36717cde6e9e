"""What is surely found beside something without a name."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from stepped_machines import DT, ELASTIC, RIGID, pendulum, record, swing

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.reasons import Doubt
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.unknown import beside_unknown, in_part
from haptic_teleop_sysid.diagnosis.decision.unknown.at_reversals import AtReversals, Turning
from haptic_teleop_sysid.diagnosis.decision.unknown.beside_unknown import leading, most_or_seen, with_names
from haptic_teleop_sysid.diagnosis.decision.unknown.in_part import (
    found_in_part,
    found_one_by_one,
    where_the_rest_is,
    with_found,
)
from haptic_teleop_sysid.diagnosis.decision.unknown.stand_in import StandIn
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.group_search import search_groups
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.terms import Hypothesis
from haptic_teleop_sysid.diagnosis.evidence.reversals import Jump
from haptic_teleop_sysid.diagnosis.evidence.second_method import SecondMethod
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.report.columns import column
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

FRICTION = Effect("coulomb_friction", "j_motor", {"torque": 0.4})
VALLEY = Effect("gravity", "j_motor", {"torque": 0.8, "phase": 0.0})


def second_method_of(**hidden):
    learn, judge = ([pendulum(seed, **hidden)] for seed in (0, 1))
    return SecondMethod(None, (), search_groups(RIGID, learn, judge, recording_scales(RIGID, learn))), learn


@pytest.fixture(scope="module")
def notched():
    """A pendulum with dry friction and a detent, which has no name."""
    return second_method_of(coulomb=0.4, detent=0.8)


def stand_in_of(learn, *effects):
    model = RIGID.with_effects(*effects)
    fit = fit_whole(model, noise_starts(model, learn)[1], learn, free=(), iterations=3)
    return StandIn(fit, effects, 0.5)


#: Friction at the motor that shows where the motion turns.
SEEN = Turning((AtReversals("coulomb_friction", "j_motor", (Jump(0.38, 0.02, 20, 2.0),) * 2),))


def result_of(fit):
    return SimpleNamespace(baseline=fit)


def group(gain, *effects):
    return SimpleNamespace(gain=gain, effects=effects)


def test_friction_is_found_beside_a_torque_without_a_name(notched):
    second_method, learn = notched
    (found,) = found_in_part(stand_in_of(learn, VALLEY, FRICTION), RIGID, second_method)
    assert (found.effect.effect, found.index) == ("coulomb_friction", 1)
    assert found.effect.values["torque"] == pytest.approx(0.4, rel=0.05)
    assert found.rest.quantities == ("motor angle",)
    assert found.adequacy > 0.9


def test_on_one_slow_sine_a_spring_is_judged_by_itself():
    """Any torque over angle or velocity, with an inertia beside it, could be the spring's there."""
    sides = []
    for phase in (0.3, 2.0):
        torque = 1.5 * np.sin(2.0 * np.pi * 0.2 * DT * np.arange(10_000) + phase)
        sides.append([record(torque, swing(torque, 0.14, 0.35, 0.0, 20.0, 0.0, 0.0, 0.0)[:, None], 1e-4)])
    second_method = SecondMethod(None, (), search_groups(RIGID, *sides, recording_scales(RIGID, sides[0])))
    best = leading(second_method.searched)[0]
    (found,) = found_one_by_one(best, second_method)
    assert best.effects[0].effect in ("gravity", "spring_to_ground")
    assert found.rest is None and found.told().startswith("it explains")
    assert next(iter(found.effect.values.values())) == pytest.approx(20.0, rel=0.1)
    assert where_the_rest_is(Verdict("unknown", [], [], [], []), [found]).where == []


def test_the_size_is_that_of_the_torque_and_what_free_runs_want_is_told(notched):
    second_method, learn = notched
    other = replace(FRICTION, parameters={"torque": 0.5})
    (found,) = found_in_part(stand_in_of(learn, other), RIGID, second_method)
    assert found.effect.values["torque"] == pytest.approx(0.4, rel=0.05)
    assert found.std["torque"] == pytest.approx(0.1 / 2**0.5, rel=0.3)
    assert "free runs with the names alone want torque 0.5" in found.told()


@pytest.mark.parametrize(("share", "stands"), [(0.95, True), (0.7, False)])
def test_of_another_form_is_only_what_explains_much_less_than_a_curve(notched, monkeypatch, share, stands):
    """In a long recording a curve over the same quantity is always clearly better."""
    second_method, learn = notched
    folds = second_method.searched.folds
    plain, one = folds.likelier, next(q for q in folds.latents if q.quantities == ("motor velocity",))

    def likelier(terms):
        return plain(terms) + (1000.0 if one in terms else 0.0)

    monkeypatch.setattr(folds, "likelier", likelier)
    monkeypatch.setattr(folds, "adequacy_beside", lambda own, rest: share)
    assert bool(found_in_part(stand_in_of(learn, FRICTION), RIGID, second_method)) is stands


def test_friction_that_is_not_there_is_not_found():
    second_method, learn = second_method_of(detent=0.8)
    assert found_in_part(stand_in_of(learn, VALLEY, FRICTION), RIGID, second_method) == []


def test_the_verdict_stays_unknown_and_no_name_in_it_is_sure(notched):
    second_method, learn = notched
    instead = stand_in_of(learn, VALLEY, FRICTION)
    given_up = Choice(Explanation(instead.fit, 50.0, 20.0, True, 0), 1.0)
    doubt = Doubt(given_up, "it explains too little", short=True)
    unknown = Verdict("unknown", [], [], [], [])
    result = result_of(instead.fit)
    verdict = with_names(unknown, result, doubt, instead, second_method, learn, lambda model: {}, SEEN)
    assert verdict.kind == "unknown"
    (finding,) = verdict.findings
    assert (finding["effect"], finding["location"]) == ("coulomb_friction", "j_motor")
    assert 0.5 <= finding["confidence"] <= 0.69
    assert "has no name" in finding["because"]
    assert [(w["equation"], w["condition"]) for w in verdict.where] == [("j_motor", "motor angle")]


def test_where_nothing_of_the_stand_in_stands_what_explains_most_torque_is_asked(notched):
    """An actuator whose stand-in was a Stribeck friction: its Coulomb friction was not told."""
    second_method, learn = notched
    instead = stand_in_of(learn, VALLEY)
    doubt = Doubt(Choice(Explanation(instead.fit, 50.0, 20.0, True, 0), 1.0), "too little", short=True)
    unknown = Verdict("unknown", [{"equation": "j_motor", "condition": "time"}], [], [], [])
    parts = found_in_part(instead, RIGID, second_method)
    assert most_or_seen(parts, SEEN) == []
    result = result_of(instead.fit)
    verdict = with_names(unknown, result, doubt, instead, second_method, learn, lambda model: {}, SEEN)
    (finding,) = verdict.findings
    assert (finding["effect"], finding["location"]) == ("coulomb_friction", "j_motor")
    assert verdict.where == unknown.where


@pytest.mark.parametrize(("load", "stands"), [(1.5, True), (0.2, False)])
def test_a_constant_torque_stands_beside_something_where_it_is_most_of_what_is_missing(load, stands):
    """A linear drive under a load: a free curve holds a constant, and none was ever told."""
    kinds = [
        [replace(r, input=r.input + load) for r in [pendulum(seed, detent=0.8)]] for seed in (0, 1)
    ]
    second_method = SecondMethod(None, (), search_groups(RIGID, *kinds, recording_scales(RIGID, kinds[0])))
    fit = stand_in_of(kinds[0], VALLEY).fit
    unknown = Verdict("unknown", [], [], [], [])
    verdict = with_names(
        unknown, result_of(fit), None, None, second_method, kinds[0], lambda model: {}, Turning()
    )
    told = [f for f in verdict.findings if f["effect"] == "constant_torque"]
    assert bool(told) is stands
    for one in told:
        assert one["parameters"]["torque"]["value"] == pytest.approx(-load, rel=0.1)
        assert one["confidence"] <= 0.69


@pytest.mark.parametrize(("more", "told"), [(-0.007, "j_arm"), (0.4, "j_motor")])
def test_the_place_of_the_rest_is_that_of_a_torque_which_predicts_something(more, told):
    where = [{"equation": "j_arm", "share": 0.8, "condition": "time", "intervals": []}]
    rest = SimpleNamespace(location="j_motor", quantities=("motor angle",))
    found = where_the_rest_is(Verdict("unknown", where, [], [], []), [SimpleNamespace(rest=rest, more=more)])
    assert found.where[0]["equation"] == told
    assert 0.0 <= found.where[0]["share"] <= 1.0


def test_whatever_made_it_unknown_what_explains_most_torque_is_asked_whether_it_stands(notched):
    second_method, learn = notched
    fit = stand_in_of(learn, FRICTION).fit
    unknown = Verdict("unknown", [{"equation": "j_motor", "condition": "time"}], [], [], [])
    doubt = Doubt(None, "something acts at some times and not at others", "time")
    verdict = with_names(unknown, result_of(fit), doubt, None, second_method, learn, lambda model: {}, SEEN)
    (finding,) = verdict.findings
    assert (finding["effect"], finding["location"]) == ("coulomb_friction", "j_motor")
    size = finding["parameters"]["torque"]
    # The detent passes for a part of it where nothing takes it on: the error says so.
    assert abs(size["value"] - 0.4) < 2.0 * size["std"]
    assert size["value"] == pytest.approx(0.4, rel=0.05)
    assert finding["confidence"] <= 0.69
    assert verdict.where == unknown.where, "where and when it is, is what was said"
    again = with_names(verdict, result_of(fit), doubt, None, second_method, learn, lambda model: {}, SEEN)
    assert again.findings == verdict.findings, "what is named already is not named twice"


def test_nothing_is_named_where_nothing_has_a_name():
    second_method, learn = second_method_of(detent=0.8)
    fit = stand_in_of(learn, VALLEY).fit
    unknown = Verdict("unknown", [], [], [], [])
    assert (
        with_names(unknown, result_of(fit), None, None, second_method, learn, lambda model: {}, SEEN)
        == unknown
    )
    assert with_names(unknown, result_of(fit), None, None, None, learn, lambda model: {}, SEEN) is unknown


def test_what_stands_must_be_most_of_what_is_missing_or_friction_that_nothing_contradicts(notched):
    second_method, learn = notched
    (found,) = found_in_part(stand_in_of(learn, VALLEY, FRICTION), RIGID, second_method)
    less = replace(found, share=0.2)
    drag = replace(less, effect=Effect("quadratic_drag", "j_motor", {"coefficient": 0.1}))
    most = replace(drag, share=0.55)
    assert most_or_seen([less, drag, most], Turning()) == [less, most]
    form = replace(less, effect=Effect("presliding_friction", "j_motor", {"torque": 0.4, "stiffness": 9.0}))
    assert most_or_seen([less, form, drag], Turning()) == [less, form]
    assert most_or_seen([less, form, drag], SEEN) == [less, form]
    # What is seen where the motion turns has the size that it has there, unless it is most of what is left.
    larger = Turning(tuple(replace(j, jumps=(Jump(0.2, 0.01, 20, 2.0),) * 2) for j in SEEN.jumps))
    assert most_or_seen([less, form, replace(less, share=0.55), drag], larger) == [replace(less, share=0.55)]
    # Where the motion turns often enough and nothing jumps, there is no dry friction.
    smooth = Turning(smooth=frozenset({("coulomb_friction", "j_motor")}))
    assert most_or_seen([less, form, replace(found, share=0.9), most], smooth) == [most]
    elsewhere = Turning(smooth=frozenset({("coulomb_friction", "j_arm")}))
    assert most_or_seen([less], elsewhere) == [less]


def test_what_the_torques_do_not_tell_from_a_name_beside_unknown_is_told_with_it(notched):
    """A wheel that turns one way: its friction is a constant torque, too."""
    second_method, learn = notched
    (found,) = found_in_part(stand_in_of(learn, VALLEY, FRICTION), RIGID, second_method)
    constant = Effect("constant_torque", "j_motor", {"torque": -0.4})
    form = Effect("presliding_friction", "j_motor", {"torque": 0.4, "stiffness": 9.0})
    delay = Effect("input_delay", "j_actuator", {"delay": 0.01})
    drag = Effect("quadratic_drag", "j_motor", {"coefficient": 0.1})
    best = group(40.0, FRICTION, VALLEY)
    level = (
        best,
        group(38.0, constant, VALLEY),  # again, with another shape
        group(39.0, constant, VALLEY),
        group(39.9, form, VALLEY),  # contains it
        group(39.5, constant, delay),  # another group altogether
        group(20.0, drag, VALLEY),  # clearly worse
    )
    searched = SimpleNamespace(levels=((group(39.9, delay),), level))
    one = in_part._with_rivals(found, best, searched)
    ((other, share),) = one.others
    assert other == constant and one.known + share / one.adequacy == pytest.approx(1.0)
    # The other one gains a log-likelihood of 1 less.
    assert one.known == pytest.approx(0.5826, abs=1e-4)
    fit = stand_in_of(learn, FRICTION).fit
    verdict = with_found(Verdict("unknown", [], [], [], []), [replace(one, index=0)], fit, 1, {})
    (told,) = verdict.findings
    assert told["effect"] == "coulomb_friction"
    assert [a["effect"] for a in told["alternatives"]] == ["constant_torque"]
    assert told["confidence"] == pytest.approx(one.adequacy * one.known, abs=0.01)


def test_one_torque_is_not_told_as_two_that_are_each_the_others_alternative(notched, monkeypatch):
    second_method, learn = notched
    constant = Effect("constant_torque", "j_motor", {"torque": -0.4})
    fit = stand_in_of(learn, FRICTION).fit
    (found,) = found_in_part(stand_in_of(learn, FRICTION), RIGID, second_method)
    most = replace(found, share=0.8)
    other = replace(most, effect=constant, share=0.7)
    by_name = {
        "coulomb_friction": [replace(most, others=((constant, 0.4),))],
        "constant_torque": [replace(other, others=((FRICTION, 0.4),))],
    }
    asked = [group(40.0, FRICTION), group(41.0, constant)]
    monkeypatch.setattr(beside_unknown, "leading", lambda searched: asked)
    monkeypatch.setattr(beside_unknown, "found_one_by_one", lambda g, _: by_name[g.effects[0].effect])
    monkeypatch.setattr(beside_unknown, "fit_of", lambda *_: fit)
    unknown = Verdict("unknown", [], [], [], [])
    verdict = with_names(unknown, result_of(fit), None, None, second_method, learn, lambda m: {}, Turning())
    (told,) = verdict.findings
    assert told["effect"] == "coulomb_friction"
    assert [a["effect"] for a in told["alternatives"]] == ["constant_torque"]


def test_friction_of_a_motion_that_never_turns_must_be_most_of_what_is_missing(notched):
    second_method, learn = notched
    (found,) = found_in_part(stand_in_of(learn, FRICTION), RIGID, second_method)
    little = replace(found, share=0.26)
    assert most_or_seen([little], Turning()) == [little]
    assert most_or_seen([replace(little, everywhere=True)], Turning()) == []


def test_at_an_arm_that_stands_still_no_constant_is_judged():
    """A jammed arm: nothing without a form exists at its place, and the largest of none was asked for."""
    made = []
    for seed in (0, 1):
        one = pendulum(seed)
        measured = np.column_stack([one.measured[:, 0], np.zeros(len(one))])
        made.append([replace(one, input=one.input + 2.0, measured=measured, resolution=(1e-5, 1e-5))])
    second_method = SecondMethod(None, (), search_groups(ELASTIC, *made, recording_scales(ELASTIC, made[0])))
    constant = Effect("constant_torque", "j_arm", {"torque": -2.0})
    group = SimpleNamespace(
        gain=9.0, effects=(constant,), hypotheses=(Hypothesis.resized(constant, "arm"),)
    )
    assert not any(
        q.place == "arm" and "time" not in q.quantities for q in second_method.searched.folds.latents
    )
    assert found_one_by_one(group, second_method) == []


def test_the_best_group_of_each_size_is_asked_if_it_gains_anything():
    def of(*levels):
        return leading(SimpleNamespace(levels=levels))

    friction, both, drift = group(40.0, FRICTION), group(60.0, FRICTION, VALLEY), group(-1.0, VALLEY)
    assert of((drift, friction), (group(50.0), both)) == [friction, both]
    assert of((drift,), ()) == []


def test_a_parameter_at_a_bound_of_the_regression_says_so(notched):
    _, learn = notched
    fit = fit_whole(RIGID, noise_starts(RIGID, learn)[1], learn, free=(), iterations=3)
    low = RIGID.with_values({"motor_inertia": 0.1})
    fit = replace(fit, model=low, free=("motor_inertia",), at_bound=("motor_inertia",))
    assert column(low, RIGID, fit)["motor_inertia"].bound == "lowest"

def test_a_stand_in_that_is_named_too_is_told_with_its_other_size():
    model = RIGID.with_effects(Effect("coulomb_friction", "j_motor", {"torque": 1.4}))
    one = StandIn(SimpleNamespace(model=model), model.effects, 0.6)
    other = one.content([])["what"]
    assert "stand-in" in other and "is not believed to be all that is missing" in other
    named = one.content([{"effect": "coulomb_friction", "location": "j_motor"}])["what"]
    assert "stand-in" not in named and "with the size that simulates best" in named and "60 % less" in named
