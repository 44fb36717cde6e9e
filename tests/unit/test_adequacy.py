"""How much findings explain, where what is left sits, and what that does to an answer."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import DT, ELASTIC, RIGID, drive, pendulum, record, two_masses

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision import adequacy as adequacies
from haptic_teleop_sysid.diagnosis.decision.adequacy import (
    Adequacy,
    Followed,
    adequacy,
    explained_torque,
    following,
    left_size,
    short_of,
)
from haptic_teleop_sysid.diagnosis.decision.coloured import left_is_random
from haptic_teleop_sysid.diagnosis.decision.name_tests.any_curve import one_curve
from haptic_teleop_sysid.diagnosis.decision.reasons import Doubt, more_than_chance
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.verdict import decide_verdict
from haptic_teleop_sysid.diagnosis.evidence.residual import _condition as condition_of_left
from haptic_teleop_sysid.diagnosis.evidence.residual import shares
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.report.page_lead import _headline as headline
from haptic_teleop_sysid.diagnosis.report.summary import explains_sentence, summary
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

#: What the pendulum is, but for its friction.
TRUE = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.35})


def fitted(model, records, free=None):
    return fit_whole(model, noise_starts(model, records)[1], records, free=free, iterations=6)


def fitted_to(model, records):
    """Noise levels alone."""
    return fit_whole(model, noise_starts(model, records)[1], records, free=(), iterations=6)


def rubbing(torque):
    return Effect("coulomb_friction", "j_motor", {"torque": torque})


def coupled(extra, seed=3):
    """Two masses whose joint pulls by ``extra``(deflection) more than its spring, N·m."""
    torque, state, h = drive(seed, 2.0), np.zeros(4), DT / 20
    found = np.empty((len(torque), 2))
    p = ELASTIC.parameters
    for k, u in enumerate(torque):
        found[k] = state[:2]
        for _ in range(20):
            bent = state[0] - state[1]
            spring = p["stiffness"] * bent + extra(bent)
            state[2] += h * (u - p["motor_damping"] * state[2] - spring) / p["motor_inertia"]
            state[3] += h * (spring - p["arm_damping"] * state[3]) / p["arm_inertia"]
            state[:2] += h * state[2:]
    return record(torque, found, 1e-5)


def test_the_whole_effect_explains_nearly_all_and_a_third_of_it_only_a_part():
    records = [pendulum(0, coulomb=0.4), pendulum(1, coulomb=0.4)]
    bare = fitted(TRUE, records[:1], ())
    parts = [explained_torque(bare, fitted(TRUE.with_effects(rubbing(t)), records[:1], ()), records)
             for t in (0.4, 0.133, 0.0)]  # fmt: skip
    assert parts[0] > 0.95
    # A third of a torque leaves four ninths of its mean square.
    assert parts[1] == pytest.approx(5 / 9, abs=0.12)
    assert parts[2] == pytest.approx(0.0, abs=0.01)


def test_what_a_name_explains_of_the_torque_is_told_by_the_sizes_that_the_torques_want():
    # A free run may want other sizes than the torques: the name is then no less near to what is missing.
    records = [pendulum(0, coulomb=0.4), pendulum(1, coulomb=0.4)]
    bare, torques, runs = (
        fitted(TRUE.with_effects(*map(rubbing, sizes)), records[:1], ()) for sizes in ((), (0.4,), (0.7,))
    )
    before, after = (0.5, 0.5), (0.1, 0.1)
    alone = adequacy(bare, runs, records, before, after)
    both = adequacy(bare, runs, records, before, after, by_torque=torques)
    assert alone.torque < 0.5
    assert both.torque == adequacy(bare, torques, records, before, after).torque > 0.95
    assert both.free_run == alone.free_run


def test_torque_explained_in_the_band_of_the_motion_is_the_least_that_is_explained():
    # An observer of fast, coarse readings corrects much that no torque makes.
    records = [pendulum(0, coulomb=0.4)]
    bare, part = (fitted(TRUE.with_effects(*e), records, ()) for e in ((), (rubbing(0.1),)))
    errors = (0.5, 0.5), (0.1, 0.1)
    alone = adequacy(bare, part, records, *errors)
    assert alone.torque < 0.5
    assert adequacy(bare, part, records, *errors, in_band=0.8) == replace(alone, torque=0.8)
    assert adequacy(bare, part, records, *errors, in_band=0.1) == alone


def test_where_nothing_worth_a_word_was_missing_nothing_is_asked_of_a_name():
    records = [pendulum(0, coulomb=0.01)]
    bare = fitted(TRUE, records, ())
    assert adequacy(bare, bare, records, (0.02, 0.03), (0.02, 0.03)) == Adequacy(1.0, 1.0)


def test_parity_equations_alone_do_not_make_an_unknown_where_nothing_worth_a_word_is_left():
    """A weak friction of the arm was `unknown` beside random torque of the arm, of which it takes nothing."""
    weak = Adequacy(1.0, 1.0, random_left=True, parity=0.0)
    assert not weak.much_is_left and weak.surest == 0.69
    for torque, free_run in ((0.9, 1.0), (1.0, 0.9)):
        assert Adequacy(torque, free_run, random_left=True, parity=0.0).much_is_left
    assert Adequacy(1.0, 1.0, random_left=False, parity=0.0).much_is_left, "what is left is not random"


@pytest.mark.parametrize(
    ("size", "white", "random"),
    [(0.05, False, True), (0.08, False, False), (0.08, True, True), (0.13, True, False)],
)
def test_beside_white_innovations_a_weak_name_may_leave_as_much_as_a_machine_without_names(
    monkeypatch, size, white, random
):
    """Effects of d' 8 beside a random torque of 6 to 7 % were `unknown`."""
    records = [pendulum(0, coulomb=0.05)]
    bare = fitted(TRUE, records, ())
    monkeypatch.setattr(adequacies, "left_size", lambda fit, records: size)
    errors = (0.5, 0.5), (0.5, 0.5)
    found = adequacy(bare, bare, records, *errors, random_left=True, white=lambda: white)
    assert found.torque < 0.5 and found.random_left is random
    assert not adequacy(bare, bare, records, *errors, random_left=False, white=lambda: True).random_left


def test_what_a_name_that_went_followed_is_missing_still():
    left, other = Followed("j_motor", "motor velocity"), Followed("j_motor", "motor angle")
    names = Adequacy(0.95, 0.95)
    assert following(names, None) is names and following(None, None) is None
    assert following(names, left).much_is_left and following(names, left).follows == left
    assert following(replace(names, follows=other), left).follows == other, "asked beside what is left"
    assert following(None, left).much_is_left, "names that the currents show alone"
    random = replace(names, random_left=True)
    assert following(random, left) is random, "it left nothing but chance"


def test_the_error_of_free_runs_counts_in_mean_squares():
    records = [pendulum(0, coulomb=0.01)]
    bare = fitted(TRUE, records, ())
    found = adequacy(bare, bare, records, (0.5, 0.5), (0.5, 0.05))
    assert found.free_run == pytest.approx(1 - (0.5 * (0.25 + 0.0025) - 0.0025) / (0.25 - 0.0025))
    assert adequacy(bare, bare, records, (0.5, 0.5), (0.7, 0.7)).free_run == 0.0
    assert adequacy(bare, bare, records, (0.5, 0.5), (np.inf, 0.1)).free_run == 0.0
    assert found.least == found.free_run


def result_with(records, torque):
    baseline = fitted(TRUE, records, ())
    final = fitted(TRUE.with_effects(rubbing(torque)), records)
    choice = Choice(Explanation(final, 100.0, 100.0, True, 0), 0.99)
    return SearchResult(baseline, final, (choice,), (), recording_scales(RIGID, records))


def test_a_model_that_does_not_follow_the_motion_explains_little_however_much_worse_it_was_before():
    records = [pendulum(0, coulomb=0.4)]
    before, after = fitted_to(TRUE, records), fitted_to(TRUE.with_effects(rubbing(0.4)), records)
    shares = [adequacy(before, after, records, (1.3, 1.3), (e, e)).free_run for e in (0.2, 0.84)]
    assert shares[0] == pytest.approx(1.0 - 0.2**2, abs=0.02) and shares[1] == pytest.approx(0.29, abs=0.02)
    assert Adequacy(0.9, shares[1]).much_is_left


def test_a_name_that_explains_less_than_half_becomes_the_nearest_one():
    records = [pendulum(0, coulomb=0.4)]
    result = result_with(records, 0.4)
    kept, doubt = short_of(result, Adequacy(0.6, 0.2))
    assert kept is result
    assert doubt is None
    bare, doubt = short_of(result, Adequacy(0.3, 0.9))
    assert bare.choices == ()
    assert bare.final is result.baseline
    assert doubt.choice is result.choices[0]
    assert "most similar effect, coulomb_friction at j_motor, explains 30 %" in doubt.why


def test_a_name_beside_which_only_chance_is_left_stands_however_little_it_takes():
    records = [pendulum(0, coulomb=0.4)]
    result = result_with(records, 0.4)
    small = Adequacy(0.1, 0.2, random_left=True)
    assert short_of(result, small) == (result, None)
    assert small.surest == pytest.approx(0.69)  # right or not, nobody is sure
    assert small.content()["torque"] == 0.1 and small.content()["left_is_random"]


def test_what_only_the_currents_show_needs_no_torque():
    records = [pendulum(0, coulomb=0.4)]
    result = result_with(records, 0.4)
    chosen = replace(result.choices[0].chosen, by_current=50.0)
    electric = replace(result, choices=(replace(result.choices[0], chosen=chosen),))
    assert short_of(electric, Adequacy(0.0, 0.0)) == (electric, None)


@pytest.mark.parametrize(
    ("explained", "confidence"),
    [
        (None, 0.95),  # who has no rival may be wrong all the same
        (Adequacy(1.0, 1.0), 0.95),
        (Adequacy(0.96, 1.0), 0.8),  # a fifth of the torque's size is left
        (Adequacy(1.0, 0.96), 0.8),
        (Adequacy(0.9, 1.0), 0.69),  # nearly a third: unsure
        (Adequacy(0.9, 1.0, random_left=True), 0.69),
        (Adequacy(0.8, 0.55), 0.55),
        (Adequacy(1.0, 1.0, recovered=0.8), 0.69),  # little is left, of which other torques explain more
        (Adequacy(1.0, 1.0, recovered=0.95), 0.95),
    ],
)
def test_nobody_is_surer_of_a_name_than_it_explains(explained, confidence):
    records = [pendulum(0, coulomb=0.4)]
    verdict = decide_verdict(result_with(records, 0.4), records, records, adequate=explained)
    assert verdict.findings[0]["confidence"] == pytest.approx(confidence)
    assert verdict.kind == "identified"


def test_a_name_beside_which_much_is_left_is_part_of_what_is_missing_and_the_verdict_unknown():
    records = [pendulum(0, coulomb=0.4)]
    result = result_with(records, 0.4)
    verdict = decide_verdict(result, records, records, adequate=Adequacy(0.8, 0.45))
    assert verdict.kind == "unknown"
    assert [(f["effect"], f["confidence"]) for f in verdict.findings] == [("coulomb_friction", 0.45)]
    assert [row["equation"] for row in verdict.where] == ["j_motor"]
    told = headline(verdict, {})[1]
    assert told.startswith("Part of what is missing is probably coulomb_friction at j_motor")
    assert "The rest no known effect explains; it sits at j_motor and comes and goes with time" in told
    rival = {"effect": "constant_torque", "location": "j_motor", "confidence": 0.43}
    open_still = replace(verdict, findings=[verdict.findings[0] | {"alternatives": [rival]}])
    assert ") or constant_torque at j_motor. The rest" in headline(open_still, {})[1]
    # Where what is left is chance the name stays, unsurely.
    by_chance = decide_verdict(result, records, records, adequate=Adequacy(0.8, 0.45, random_left=True))
    assert (by_chance.kind, by_chance.findings[0]["confidence"]) == ("identified", 0.69)


def test_a_name_that_leaves_what_follows_a_quantity_stands_beside_an_unknown():
    """Not of a benchmark: the push of an amplifier that is stronger than its pull, taken for a constant."""
    records = [pendulum(0, coulomb=0.4)]
    left = Adequacy(0.97, 0.99, follows=Followed("j_motor", "input torque"))
    verdict = decide_verdict(result_with(records, 0.4), records, records, adequate=left)
    assert verdict.kind == "unknown" and [row["equation"] for row in verdict.where] == ["j_motor"]
    assert [(f["effect"], f["confidence"]) for f in verdict.findings] == [("coulomb_friction", 0.69)]
    bare = fitted_to(TRUE, records)
    found = adequacy(bare, bare, records, (0.5, 0.5), (0.1, 0.1), follows=Followed("j_motor", "input torque"))
    assert found.follows.quantity == "input torque" and found.much_is_left
    # A curve through chance follows nothing.
    nothing = Followed("j_motor", "input torque")
    by_chance = adequacy(bare, bare, [pendulum(0)], (0.5, 0.5), (0.1, 0.1), True, follows=nothing)
    assert by_chance.follows is None


def test_a_name_with_which_your_own_model_is_better_shows_nothing():
    records = [pendulum(0, coulomb=0.4)]
    verdict = decide_verdict(
        result_with(records, 0.4), records, records, adequate=Adequacy(1.0, 1.0, random_left=True, worse=True)
    )
    assert verdict.kind == "unknown"
    assert [(f["effect"], f["confidence"]) for f in verdict.findings] == [("coulomb_friction", 0.69)]
    assert verdict.where[0]["equation"] == "j_motor" and verdict.where[0]["condition"] != "time"


@pytest.mark.parametrize(("coulomb", "random"), [(0.1, False), (0.08, True)])
def test_a_torque_larger_than_chance_is_not_random_beside_a_name_that_explains_less(coulomb, random):
    records = [pendulum(0, coulomb=coulomb)]
    bare = fitted_to(TRUE, records)
    little = fitted_to(TRUE.with_effects(rubbing(0.1 * coulomb)), records)
    assert (left_size(little, records) <= 0.06) == random
    found = adequacy(bare, little, records, (0.5, 0.5), (0.1, 0.1), random_left=True)
    assert found.torque < 0.5 and found.random_left == random
    most = fitted_to(TRUE.with_effects(rubbing(0.9 * coulomb)), records)
    assert adequacy(bare, most, records, (0.5, 0.5), (0.1, 0.1), random_left=True).random_left


@pytest.mark.parametrize(
    ("order", "beside", "falls"),
    [
        (2.0, "spring_to_ground", True),
        (2.0, "coulomb_friction", False),  # not over the angle
        (40.0, "spring_to_ground", False),  # many cycles are seen
    ],
)
def test_a_ripple_of_one_cycle_and_a_spring_are_one_curve_without_a_name(order, beside, falls):
    records = [pendulum(0, coulomb=0.4)]
    scales = recording_scales(RIGID, records)
    cycles = 2.0 * np.pi / scales.at("j_motor").span
    ripple = Effect("torque_ripple", "j_motor", {"amplitude": 0.3, "order": 0.5 * order * cycles})
    other = rubbing(0.4) if beside == "coulomb_friction" else Effect(beside, "j_motor", {"stiffness": 2.0})
    fits = [fitted(TRUE.with_effects(*some), records, ()) for some in ((), (ripple,), (ripple, other))]
    choices = tuple(Choice(Explanation(f, 90.0, 90.0, True, k), 0.95) for k, f in enumerate(fits[1:]))
    result = SearchResult(fits[0], fits[2], choices, (), scales)
    bare, doubt = one_curve(result)
    assert (bare.choices == ()) == falls == (doubt is not None)
    if falls:
        assert "come near to any curve over it" in doubt.why and len(bare.given_up) == 2


@pytest.mark.parametrize("effect", ["coulomb_friction", "sensor_delay"])
def test_beside_something_unknown_what_no_free_run_shows_must_be_a_torque(effect):
    records = [pendulum(0, coulomb=0.4)]
    result = result_with(records, 0.4)
    (choice,) = result.choices
    if effect == "sensor_delay":
        late = Effect(effect, "j_motor_encoder", {"delay": 0.01})
        fit = replace(result.final, model=replace(result.final.model, effects=(late,)))
        choice = replace(choice, chosen=replace(choice.chosen, fit=fit))
        result = replace(result, final=fit, choices=(choice,))
    verdict = decide_verdict(result, records, records, adequate=Adequacy(0.5, 0.0))
    assert verdict.kind == "unknown"
    told = [(f["effect"], f["confidence"]) for f in verdict.findings]
    assert told == ([("coulomb_friction", 0.0)] if effect == "coulomb_friction" else [])


@pytest.mark.parametrize(
    ("place", "made"),
    [
        ("joint", lambda: coupled(lambda bent: 12.0 * np.tanh(bent / 0.02))),
        ("motor", lambda: coupled(lambda bent: 0.0)),
        ("arm", lambda: record(t := drive(3, 2.0), two_masses(t, 20.0, (0.06, 0.3), (0.1, 0.02), 0.4), 1e-5)),
    ],
)
def test_what_is_left_sits_at_the_equation_where_it_acts(place, made):
    one = made()
    if place == "motor":  # a part of the input never arrives
        one = replace(one, input=one.input * 1.3)
    found = shares(fitted(ELASTIC, [one], ()), [one])
    assert sum(found.values()) == pytest.approx(1.0)
    assert max(found, key=found.get) == place
    assert found[place] > 0.8


@pytest.mark.parametrize(("named", "torque"), [("j_motor", 0.05), ("j_arm", 0.4)])
def test_the_place_of_a_name_that_was_given_up_is_told_only_if_it_explains_most(named, torque):
    drive_ = drive(3, 2.0)
    one = record(drive_, two_masses(drive_, 20.0, (0.06, 0.3), (0.1, 0.02), 0.4), 1e-5)
    bare = fitted_to(ELASTIC, [one])
    fit = fitted_to(ELASTIC.with_effects(Effect("coulomb_friction", named, {"torque": torque})), [one])
    choice = Choice(Explanation(fit, 100.0, 100.0, True, 0), 1.0)
    result = SearchResult(bare, bare, (), (), recording_scales(ELASTIC, [one]))
    verdict = decide_verdict(result, [one], [one], Doubt(choice, "for a reason"))
    assert verdict.kind == "unknown"
    # The friction is at the arm: the motor's explains little, and is not where it sits.
    assert verdict.where[0]["equation"] == "j_arm"


def test_a_rigid_joint_has_one_equation():
    one = pendulum(0, coulomb=0.4)
    assert shares(fitted(TRUE, [one], ()), [one]) == {"motor": 1.0}


def test_a_reader_is_told_how_much_was_explained_unless_it_is_nearly_all():
    content = {
        "findings": [{}],
        "adequacy": {"torque": 0.85, "free_run": 0.48},
        "left_over": {"equation": "j_motor", "follows": "motor velocity", "explained": 0.66},
    }
    assert explains_sentence(content) == (
        "What is named explains 85 % of the torque that the structure lacks and 48 % of the error of its "
        "free runs; 66 % of the torque that is left at j_motor follows the motor velocity."
    )
    assert explains_sentence(content | {"adequacy": {"torque": 0.95, "free_run": 0.92}}) == ""
    assert explains_sentence(content | {"findings": []}) == ""
    white = {"adequacy": {"torque": 0.2, "free_run": 0.3, "left_is_random": True}}
    told = explains_sentence(content | white)
    assert told.startswith("What is named is 20 % of the torque") and "the rest is random" in told
    assert explains_sentence(content | {"adequacy": None}) == ""


def test_a_quiet_recording_has_no_more_chance_in_it_than_a_loud_one(monkeypatch):
    """The same torque by chance, 0.05 N·m, beside an input of 1 and of 0.1 N·m."""
    loud, quiet = (replace(pendulum(0), input=rms * np.ones(len(pendulum(0)))) for rms in (1.0, 0.1))
    monkeypatch.setattr(adequacies, "_added", lambda _, records: np.full(len(records), 0.05))
    bare = fitted(TRUE, [pendulum(0)], ())
    constant = TRUE.parameters["torque_constant"]
    assert left_size(bare, [loud]) == pytest.approx(0.05 / constant)
    assert left_size(bare, [loud, quiet]) == pytest.approx(0.05 / constant * np.sqrt(2.0 / 1.01))
    # A joint that swings freely has no input at all.
    free = replace(quiet, input=np.zeros(len(quiet)))
    assert left_size(bare, [loud, free]) == pytest.approx(0.05 / constant * np.sqrt(2.0))


def test_where_an_observer_overflows_the_inverse_dynamics_say_how_much_is_explained(monkeypatch):
    records = [pendulum(0, coulomb=0.4)]
    bare = fitted(TRUE, records, ())
    assert left_size(bare, records) < 1.0
    monkeypatch.setattr(adequacies, "added_torque", lambda *_: np.array([1e5, 0.0]))
    monkeypatch.setattr(adequacies, "_added", lambda _, found: np.full(len(found), 1e5))
    assert left_size(bare, records) == np.inf and more_than_chance(np.inf) is None
    asked = adequacy(bare, bare, records, (0.5, 0.5), (0.1, 0.1), by_motion=lambda: 0.8)
    assert asked.torque == 0.8
    assert adequacy(bare, bare, records, (0.5, 0.5), (0.1, 0.1)).torque == 0.0
    # What has no size is not said to be random.
    assert not left_is_random(bare, records, records)


@pytest.mark.filterwarnings("error")
def test_a_torque_without_a_size_follows_nothing():
    follows = np.linspace(-1.0, 1.0, 400)
    for size in (1e200, np.inf):
        torque = size * np.where(follows > 0.0, 1.0, -1.0)
        found = condition_of_left("j_motor", "motor angle", (follows, 1e-200 * torque), (follows, torque))
        assert found.explained == 0.0


def test_the_terminal_says_where_what_has_no_name_is_before_the_names_beside_it():
    torque = {"value": 0.4, "std": 0.01, "unit": "N*m"}
    nothing = {part: {} for part in ("estimation", "validation", "test")}
    content = {
        "verdict": "unknown",
        "where": [{"equation": "j_motor", "condition": "motor angle"}],
        "findings": [
            {"effect": "coulomb_friction", "location": "j_motor", "confidence": 0.45, "alternatives": [],
             "parameters": {"torque": torque}},
        ],
        "worse_than_given": None,
        "adequacy": None,
        "parameters_moved": [],
        "augmented_model": {"holds": "augmented"},
        "models": {"augmented": {"parameters": {}}},
        "fit": dict.fromkeys(("given", "baseline", "augmented"), nothing),
    }  # fmt: skip
    verdict, nameless, name = summary(content).splitlines()[:3]
    assert verdict == "verdict: unknown"
    said = "something without a name at j_motor, where it depends on motor angle; beside it:"
    assert nameless.strip() == said
    assert name.strip().startswith("coulomb_friction at j_motor (45 %)")
    rigid = summary({**content, "structure": "rigid_body"}).splitlines()[1]
    assert "at j_motor (motor, actuator or encoder: a rigid joint has one equation" in rigid
    at_encoder = {"equation": "j_motor_encoder", "condition": "motor angle"}
    told = summary({**content, "structure": "rigid_body", "where": [at_encoder]})
    assert "one equation" not in told
    # Amperes in place of newton metres are a torque constant as large as the search may make it.
    highest = {"torque_constant": {"value": 71.4, "unit": "N*m/A", "at_bound": "highest"}}
    told = summary({**content, "models": {"augmented": {"parameters": highest}}})
    assert (
        "torque constant 71.4 N·m/A is the highest value allowed: see whether the input has its unit" in told
    )
