"""What the numbers of the policy decide: on either side of each, the answer is another one. The sizes are
those that a user of the tool meets, stated here and read nowhere."""

import ast
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, explanation, fit_of, result_of

import haptic_teleop_sysid.diagnosis.decision.name_tests.doubt as doubt_module
import haptic_teleop_sysid.diagnosis.decision.search.explore as explore_module
import haptic_teleop_sysid.diagnosis.decision.search.without_the_first as first_module
import haptic_teleop_sysid.diagnosis.decision.where as where_module
import haptic_teleop_sysid.diagnosis.evidence.second_method as second_module
import haptic_teleop_sysid.diagnosis.policy as policy
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision import coloured
from haptic_teleop_sysid.diagnosis.decision.adequacy import Adequacy, short_of
from haptic_teleop_sysid.diagnosis.decision.reasons import Doubt, more_than_chance
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice, choose, significant
from haptic_teleop_sysid.diagnosis.decision.second_method.overruled import believed_instead
from haptic_teleop_sysid.diagnosis.decision.second_method.torques_explained import inadequate
from haptic_teleop_sysid.diagnosis.decision.where import structured
from haptic_teleop_sysid.diagnosis.evidence.memory import Remembered
from haptic_teleop_sysid.diagnosis.evidence.residual import Condition
from haptic_teleop_sysid.diagnosis.explain import unharmful
from haptic_teleop_sysid.diagnosis.report.columns import Number, moved

FOLDER = Path(policy.__file__).parent
FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})


@pytest.mark.parametrize(
    ("here", "elsewhere", "believed"),
    [
        (12.5, 1.6, True),
        (11.5, 1.9, False),  # hardly more than clean recordings give
        (11.5, 2.1, True),  # the other recordings make up for what is missing
        (6.1, 7.3, False),
        (6.1, 7.5, True),
        (5.9, 500.0, False),
        (12.1, 1.3, False),  # the other recordings do not bear it out
        (21.0, -0.15, True),  # the more it gains, the less is asked of them
        (21.0, -0.35, False),
        (31.0, -1.9, True),  # a stop that they never reached
        (31.0, -2.1, False),
        (500.0, -2.1, False),
    ],
)
def test_what_an_effect_must_gain(here, elsewhere, believed):
    found = choose([explanation("coulomb_friction", here, elsewhere)], 0.0, False)
    assert (found is not None) == believed


@pytest.mark.parametrize(("here", "believed"), [(11.9, False), (12.1, True)])
def test_a_further_effect_must_gain_it_where_it_is_fitted(here, believed):
    found = choose([explanation("coulomb_friction", here, 500.0)], 0.0, False, further=True)
    assert (found is not None) == believed


@pytest.mark.parametrize(("worth", "falls"), [(11.0, True), (13.0, False)])
def test_a_first_effect_is_worth_as_much_beside_the_second(monkeypatch, worth, falls):
    second = explanation("coulomb_friction", 100.0, 100.0)
    second = replace(second, fit=replace(second.fit, log_likelihood=500.0))
    alone = replace(second.fit, log_likelihood=500.0 - worth)
    monkeypatch.setattr(first_module, "_without_first", lambda *_: alone)
    monkeypatch.setattr(first_module, "judged", lambda baseline, fits, *_: [replace(second, fit=fits[0])])
    assert bool(first_module.without_the_first(fit_of(), Choice(second, 1.0), [], [], None, {})) == falls


@pytest.mark.parametrize(("errors", "differs"), [(2.7, False), (3.3, True)])
def test_a_size_is_three_standard_errors_from_none(errors, differs):
    found = explanation("coulomb_friction", 100.0, 100.0, torque=0.1)
    free = ("stage1_motor.coulomb_friction.torque",)
    known = replace(found.fit, free=free, information=np.array([[(errors / 0.1) ** 2]]))
    assert significant(replace(found, fit=known)) == differs
    parameter = Number(1.5 * MODEL.parameters["stiffness"], "N*m/rad", None, 0.5, None)
    parameter = replace(parameter, std=0.5 * MODEL.parameters["stiffness"] / errors)
    assert bool(moved(MODEL, {"stiffness": parameter})) == differs


@pytest.mark.parametrize(("percent", "kept"), [(88.3, True), (87.7, False)])
@pytest.mark.parametrize("kind", [0, 1])
def test_a_finding_may_cost_two_percent_of_the_simulation_of_either_kind(percent, kept, kind):
    choice = Choice(explanation("coulomb_friction", 100.0, 100.0), 1.0)
    with_it = (percent, 95.0) if kind == 0 else (95.0, percent)
    found = unharmful(result_of(choice), lambda model: with_it if model.effects else (90.0, 90.0))
    assert bool(found.choices) == kept


def beside(name, *, place, effect, gain, **parameters):
    """An explanation of score ``gain`` at ``place`` beside an ``effect`` that was found."""
    own = Effect(name, f"stage1_{place}", parameters)
    one = explanation(name, gain / 2, gain / 2, place, **parameters)
    return replace(one, fit=fit_of(MODEL.with_effects(effect, own)), effect_index=1)


@pytest.mark.parametrize(
    ("name", "place", "size", "least"),
    [
        ("gravity", "arm", {"torque": 0.1}, 0.02),
        ("coulomb_friction", "motor", {"torque": 0.1}, 0.15),  # of its kind, where a drag was found
        ("inertial_coupling", "arm", {"coefficient": 0.01}, 0.0005),  # follows another joint
    ],
)
def test_a_further_effect_has_its_share_of_the_strongest_one(name, place, size, least):
    drag = Effect("quadratic_drag", "stage1_motor", {"coefficient": 0.1})
    one = beside(name, place=place, effect=drag, gain=102.0, **size)
    assert one.score == 100.0
    assert choose([one], 0.9 * 100.0 / least, False) is not None
    assert choose([one], 1.1 * 100.0 / least, False) is None


def test_a_further_effect_of_which_nobody_knows_what_it_is_has_a_larger_one():
    here = explanation("gravity", 52.0, 50.0, "arm", torque=0.1)
    there = explanation("encoder_scale", 52.0, 50.0, "arm_encoder", scale=1.01)
    assert choose([here, there], 0.9 * 100.0 / 0.15, False).ambiguous
    assert choose([here, there], 1.1 * 100.0 / 0.15, False) is None


def test_a_rival_three_nats_behind_has_a_third_of_the_weight():
    first = explanation("coulomb_friction", 22.0, 20.0)
    second = explanation("constant_torque", 18.8, 20.0)
    choice = choose([first, second], 0.0, False)
    # The score is 40: 3.2 nats behind where chance makes 3 and the noise's colour 0.4.
    assert choice.chosen is first
    assert choice.confidence == pytest.approx(1.0 / (1.0 + np.exp(-3.2 / 3.4)), abs=0.002)


@pytest.mark.parametrize(("apart", "alike"), [(4.6, True), (5.4, False)])
def test_explanations_five_nats_apart_are_one_set(apart, alike):
    delay = explanation("input_delay", 37.0, 6.0, "actuator", delay=0.008)
    lag = explanation("actuator_lag", 32.4, 6.0, "actuator", time_constant=0.008)
    found = choose([delay, lag], 0.0, True, apart=lambda *_: apart)
    assert found.ambiguous == alike
    # ... which was found, too: what is farther behind is told by that.
    behind = replace(lag, gain=31.6)
    assert not choose([delay, behind], 0.0, True, apart=lambda *_: 0.0).ambiguous


@pytest.mark.parametrize(("confidence", "open_"), [(0.68, True), (0.72, False)])
def test_a_name_is_given_alone_from_seventy_percent_on(confidence, open_):
    rival = explanation("constant_torque", 40.0, 40.0)
    choice = Choice(explanation("coulomb_friction", 40.0, 40.0), confidence, ((rival, 1.0 - confidence),))
    assert choice.ambiguous == open_


@pytest.mark.parametrize(("ahead", "unnamed"), [(7.0, False), (9.0, True)])
def test_every_name_has_to_lose_by_eight_nats_before_none_is_given(ahead, unnamed):
    name = explanation("quadratic_drag", 40.0, 40.0, coefficient=0.1)
    nameless = explanation("steep_drag", 40.0 + ahead, 40.0, coefficient=0.1)
    assert choose([name, nameless], 0.0, False).unnamed == unnamed


def group(gain, *names):
    effects = [Effect(name, "stage1_motor", {"torque": 0.1}) for name in names]
    return SimpleNamespace(effects=effects, gain=gain, model=MODEL)


@pytest.mark.parametrize(
    ("gains", "count"), [((5.4, 0.0), 0), ((6.6, 0.0), 1), ((20.0, 25.4), 1), ((20.0, 26.6), 2)]
)
def test_each_effect_gains_a_log_likelihood_of_six_by_the_second_method(monkeypatch, gains, count):
    monkeypatch.setattr(second_module, "admissible", lambda *_: True)
    one, two = group(gains[0], "gravity"), group(gains[1], "gravity", "coulomb_friction")
    said = SimpleNamespace(levels=[[one], [two]], settling=lambda group: None)
    judged = second_module.judge_groups(said, None, lambda model: (0.5, 0.5), (0.5, 0.5))
    assert len(judged.chosen.group.effects if judged.chosen else ()) == count


@pytest.mark.parametrize(
    ("errs", "coloured", "believed"),
    [
        (0.92, True, False),
        (0.88, True, True),
        (0.88, False, False),
        (0.72, False, False),
        (0.68, False, True),
    ],
)
def test_the_second_method_errs_clearly_less(errs, coloured, believed):
    known = SimpleNamespace(entry=FRICTION.entry, location=FRICTION.location)
    group = SimpleNamespace(effects=(), hypotheses=(known,))
    chosen = SimpleNamespace(errors=(0.2 * errs, 0.2 * errs), group=group)
    second_method = SimpleNamespace(chosen=chosen, searched=SimpleNamespace(folds=None))
    assert believed_instead(second_method, [], (0.2, 0.2), lambda: coloured) == believed
    same = [FRICTION]
    told = believed_instead(second_method, same, (0.2, 0.2), lambda: coloured)
    assert told == (errs < 0.9), "the same names with other sizes need no coloured innovations"


@pytest.mark.parametrize(("explains", "kept"), [(0.53, True), (0.47, False)])
@pytest.mark.parametrize(("worse", "judges"), [(1.0, True), (1.4, True), (1.5, False)])
def test_a_name_explains_half(explains, kept, worse, judges):
    choice = Choice(explanation("coulomb_friction", 100.0, 100.0), 1.0)
    result, doubt = short_of(result_of(choice), Adequacy(explains, 0.9))
    assert bool(result.choices) == kept and (doubt is None) == kept
    folds = SimpleNamespace(adequacies=lambda group: [explains for _ in group])
    judged = SimpleNamespace(searched=SimpleNamespace(folds=folds, with_names=lambda group: None))
    errors = lambda model: (0.1, 0.1) if model is not None else (0.1 * worse, 0.1 * worse)  # noqa: E731
    doubt = inadequate(result_of(choice), judged, errors)
    assert (doubt is None) == (kept or not judges), "who simulates the name far worse does not judge it"


@pytest.mark.parametrize(("explains", "place"), [(0.53, "stage1_motor"), (0.47, "stage1_arm")])
def test_the_place_of_a_name_that_was_given_up_is_told_where_it_explains_half(monkeypatch, explains, place):
    monkeypatch.setattr(where_module, "_largest", lambda *_: ("stage1_arm", 0.8))
    monkeypatch.setattr(where_module, "explained_torque", lambda *_: explains)
    doubt = Doubt(Choice(explanation("coulomb_friction", 100.0, 100.0), 1.0), "for a reason")
    assert where_module.doubtful_place(doubt, result_of(), [], [])["equation"] == place


@pytest.mark.parametrize(
    ("colour", "unsteady", "gain", "said"),
    [
        (90.0, 1.2, 35.0, ""),
        (110.0, 1.2, 35.0, "keeps correcting"),
        (90.0, 1.4, 35.0, "at some times"),
        (90.0, 1.2, 45.0, "do not bear it out"),
    ],
)
def test_what_is_left_of_a_structure_is_doubted(monkeypatch, colour, unsteady, gain, said):
    answers = {
        "colour": colour,
        "unsteadiness": unsteady,
        "more_coloured": True,
        "held_out_fit": fit_of(),
    }
    for name, answer in answers.items():
        monkeypatch.setattr(doubt_module, name, lambda *_, answer=answer: answer)
    monkeypatch.setattr(doubt_module, "rather_event", lambda doubt, both: doubt)
    tried = explanation("coulomb_friction", gain, -50.0)
    _, doubt, _ = doubt_module.doubted(
        result_of(last_round=(tried,)), [], [], lambda model: (50.0,), lambda *_: True
    )
    assert (doubt.why if doubt else "") == "" if not said else said in doubt.why


@pytest.mark.parametrize(
    ("explained", "size", "counts"),
    [(0.55, 0.035, True), (0.45, 0.035, False), (0.55, 0.025, False)],
)
def test_what_is_left_and_follows_something_is_physics_without_a_name(explained, size, counts):
    left = Condition("stage1_motor", "motor angle", "rad", explained, np.zeros(8), np.full(8, size))
    assert (structured(fit_of(), [left], [], result_of()) is not None) == counts


@pytest.mark.parametrize(
    ("colour", "explained", "size", "added", "detail", "random"),
    [
        (90.0, 0.08, 0.04, 0.16, 0.02, True),
        (90.0, 0.12, 0.04, 0.16, 0.02, False),
        (90.0, 0.12, 0.02, 0.16, 0.02, True),
        (110.0, 0.08, 0.04, 0.16, 0.02, False),
        (90.0, 0.08, 0.04, 0.18, 0.02, False),
        (90.0, 0.08, 0.04, np.nan, 0.02, False),
        (90.0, 0.08, 0.04, 0.16, 0.04, False),
    ],
)
def test_what_is_left_is_random_where_it_is_white_small_and_follows_nothing_to_speak_of(
    monkeypatch, colour, explained, size, added, detail, random
):
    record = SimpleNamespace(input=np.ones(10))
    driven = fit_of().model.parameters["torque_constant"]
    curve = np.full(8, size * driven)
    left = Condition("stage1_motor", "motor angle", "rad", explained, np.zeros(8), curve)
    answers = {"colour": colour, "more_coloured": True, "held_out_fit": fit_of(), "conditions": [left]}
    answers |= {"left_size": added, "remembered": []}
    answers |= {"with_both_kinds": [], "follows_input_finely": detail * driven}
    for name, answer in answers.items():
        monkeypatch.setattr(coloured, name, lambda *_, answer=answer: answer)
    assert coloured.left_is_random(fit_of(), [record], []) == random


@pytest.mark.parametrize(
    ("followed", "taken"),
    [
        ([(0.49, 0.08)], None),  # less than half of it
        ([(0.51, 0.055)], None),  # as small as chance on a machine
        ([(0.51, 0.065)], 0),
        # The larger of those that count, and not of all.
        ([(0.45, 0.09), (0.6, 0.07), (0.9, 0.065)], 1),
    ],
)
def test_what_is_left_follows_the_past_of_a_quantity_where_that_is_most_of_it_and_no_chance(
    monkeypatch, followed, taken
):
    record = SimpleNamespace(input=np.ones(10))
    driven = fit_of().model.parameters["torque_constant"]
    found = [Remembered("stage1_motor", "input torque", share, size * driven) for share, size in followed]
    monkeypatch.setattr(coloured, "remembered", lambda *_: found)
    assert coloured.with_a_memory(fit_of(), [record], []) is (None if taken is None else found[taken])


@pytest.mark.parametrize(("added", "said"), [(0.12, ""), (0.13, "13 %"), (np.inf, "")])
def test_a_large_torque_that_follows_nothing_is_something_unknown(added, said):
    doubt = more_than_chance(added)
    assert (doubt is not None) == bool(said)
    assert doubt is None or said in doubt.why


@pytest.mark.parametrize(("gained", "goes_on"), [(5.9, []), (6.1, ["a"])])
def test_what_gains_too_little_on_thinned_recordings_is_not_fitted_on_all_samples(
    monkeypatch, gained, goes_on
):
    """With a fit of the model so far that ends at 100 there, and one effect that ends so much above it."""
    trial = replace(fit_of(MODEL.with_effects(FRICTION), 100.0 + gained), message="a")
    near, ended = fit_of(log_likelihood=100.0), []
    as_it_is = {
        "_tried": lambda *_: explore_module._Trials([trial], [[trial]], ["thinned"], near),
        "polish": lambda fit, records, *_: (ended.append(fit.message) if records == ["all"] else None) or fit,
        "with_contact": lambda fit: fit,
        "with_companion": lambda fit, *_: fit,
        "colour": lambda *_: 25.0,
        "material": lambda *_: True,
        "richer_forms": lambda *_: [],
        "with_shadows": lambda fits, *_: fits,
        "within_reach": lambda *_: None,
        "better_baseline": lambda fit, *_: fit,
        "judged": lambda *_: [],
    }
    for name, instead in as_it_is.items():
        monkeypatch.setattr(explore_module, name, instead)
    scales = SimpleNamespace(driven=lambda _: None)
    explore_module.explore(fit_of(log_likelihood=500.0), MODEL, ["all"], [], scales, shifted={})
    assert ended == goes_on


def test_every_number_says_what_it_means_and_where_it_comes_from():
    """... in a text that stands behind it, and is used by a module beside it."""
    body = ast.parse((FOLDER / "policy.py").read_text()).body
    texts = {}
    for one, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(one, ast.Assign):
            target = one.targets[0]
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            texts |= {name.id: after.value.value if told else "" for name in names}
    used = {
        alias.name
        for path in FOLDER.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").endswith("policy")
        for alias in node.names
    }
    assert used == set(texts)
    for name, text in texts.items():
        assert len(text) > 100, name
        origin = " ".join(text.lower().split())
        assert any(w in origin for w in ("by hand", "set on", "set above", "computed", "set at")), name
