"""A wrong name gives itself away: by another size on other recordings, or by innovations as coloured as
before. A right one does not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_rigs import DRAG, DT, MODEL, borne_out, joint_record, unimpressed
from identification_plants import STAGE, stage_recording

import haptic_teleop_sysid.diagnosis.decision.name_tests.doubt as doubt_module
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis import explain as explaining
from haptic_teleop_sysid.diagnosis import question as questioning
from haptic_teleop_sysid.diagnosis import run as diagnosis
from haptic_teleop_sysid.diagnosis.decision import coloured
from haptic_teleop_sysid.diagnosis.decision.name_tests import objections
from haptic_teleop_sysid.diagnosis.decision.name_tests.doubt import _without_last, doubted
from haptic_teleop_sysid.diagnosis.decision.reasons import Doubt, off_the_mark
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.decision.stand import Stand, stand_of, stands_out
from haptic_teleop_sysid.diagnosis.evidence.whiteness import colour, in_steps, unsteadiness
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.records import record_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole, noise_starts
from haptic_teleop_sysid.recordings.dataset import load_dataset


def recorded(truth, rms, seed):
    recording = stage_recording(truth, seed=seed, seconds=10.0, rms=rms, band=(0.2, 4.0))
    return record_from(load_dataset(recording, STAGE), commanded=True)


@pytest.fixture(scope="module")
def records():
    truth = STAGE.with_effects(DRAG)
    return [recorded(truth, 0.2, 1)], [recorded(truth, 0.07, 2)]


FOUND = {}
"""What `found` made before, with the recordings that it is of."""


def found(effect, estimation):
    """A search that ended with one effect, rightly or wrongly."""
    key = (effect.effect, effect.location, *effect.values.items(), *map(id, estimation))
    if key not in FOUND:
        FOUND[key] = _found(effect, estimation), estimation
    return FOUND[key][0]


def _found(effect, estimation):
    baseline = fit_from_scratch(STAGE, estimation)
    model = STAGE.with_effects(effect)
    starts = [baseline.noise, *noise_starts(model, estimation)]
    fits = [fit_whole(model, noise, estimation, iterations=30) for noise in starts]
    fit = max(fits, key=lambda f: f.log_likelihood)
    choice = Choice(Explanation(fit, fit.log_likelihood - baseline.log_likelihood, 50.0, True, 0), 1.0)
    return SearchResult(baseline, fit, (choice,), (), recording_scales(STAGE, estimation))


def test_the_right_name_stands(records):
    result = found(DRAG, records[0])
    kept, doubt, _ = doubted(result, *records, unimpressed, borne_out)
    assert doubt is None
    assert kept.choices == result.choices


def test_what_only_one_step_predictions_speak_for_stands_only_while_those_are_white(records):
    asked = []

    def never(fit, so_far, effect):
        asked.append(effect)
        return False

    kept, doubt, _ = doubted(found(DRAG, records[0]), *records, unimpressed, never)
    assert kept.choices and doubt is None and not asked, "white: likelihoods are to be believed"
    # A spring explains a little of what else acts, whose torque stays in the innovations.
    other = Effect("spring_to_ground", "stage1_motor", {"stiffness": 0.01, "rest": 0.0})
    kept, doubt, _ = doubted(found(other, records[0]), *records, unimpressed, never)
    assert not kept.choices and "only one-step predictions speak for spring_to_ground" in doubt.why
    assert [e.effect for e in asked] == ["spring_to_ground"]


def test_what_coarse_encoders_colour_is_not_held_against_a_name(monkeypatch, records):
    for module in (doubt_module, objections):
        monkeypatch.setattr(module, "colour", lambda *_: 600.0)
    monkeypatch.setattr(coloured, "expected_colour", lambda *_: 400.0)
    monkeypatch.setattr(doubt_module, "rounding_shows", lambda *_: False)
    for steps, stands in ((0.35, True), (2.0, False)):
        monkeypatch.setattr(coloured, "in_steps", lambda *_, s=steps: s)
        kept = doubted(found(DRAG, records[0]), *records, unimpressed, lambda *_: False)[0]
        assert bool(kept.choices) == stands


@pytest.mark.parametrize(("percent", "stands"), [(30.0, True), (15.0, False)])
def test_steps_of_an_encoder_do_not_make_free_runs_better(monkeypatch, records, percent, stands):
    """A rig with two rotors: its gravity gains on simulated recordings without it, too, because they wander,
    but free runs err by a third with it."""
    for module in (doubt_module, objections):
        monkeypatch.setattr(module, "colour", lambda *_: 600.0)
    monkeypatch.setattr(coloured, "expected_colour", lambda *_: 400.0)
    monkeypatch.setattr(coloured, "in_steps", lambda *_: 0.35)
    monkeypatch.setattr(doubt_module, "rounding_shows", lambda *_: True)
    simulated = lambda model: (percent,) if model.effects else (10.0,)  # noqa: E731
    kept, doubt, _ = doubted(found(DRAG, records[0]), *records, simulated, lambda *_: False)
    assert bool(kept.choices) == stands
    assert stands or "with encoders this coarse" in doubt.why


def test_a_wrong_name_is_given_up(records):
    # What grows with the square of speed passes for dry friction, of a size that depends on the amplitude.
    wrong = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})
    kept, doubt, _ = doubted(found(wrong, records[0]), *records, unimpressed, borne_out)
    assert kept.choices == ()
    assert kept.final is kept.baseline
    assert "coulomb_friction" in doubt.why


def knocked_readings(record, seed):
    """The record with readings that are off by milliradians for some samples, six times."""
    measured, rng = record.measured.copy(), np.random.default_rng(seed)
    for start in rng.integers(600, len(measured) - 100, 6):
        measured[start : start + 6] += 5e-3 * rng.normal(size=(6, 1))
    return replace(record, measured=measured)


def test_a_right_name_stands_beside_something_that_acts_at_some_times(records):
    learn, judge = ([knocked_readings(one, seed) for one in kind] for seed, kind in enumerate(records))
    result = found(DRAG, learn)
    kept, doubt, _ = doubted(result, learn, judge, unimpressed, borne_out)
    assert doubt is None and kept.choices == result.choices


def test_a_name_that_explains_little_is_given_up_beside_it_and_told(records):
    clean = [recorded(STAGE, 0.2, 3)], [recorded(STAGE, 0.07, 4)]
    learn, judge = ([knocked_readings(one, seed) for one in kind] for seed, kind in enumerate(clean))
    result = found(Effect("coulomb_friction", "stage1_motor", {"torque": 0.05}), learn)
    kept, doubt, _ = doubted(result, learn, judge, unimpressed, borne_out)
    assert kept.choices == () and doubt is not None
    assert [one.found.effect.effect for one in kept.given_up] == ["coulomb_friction"]
    assert kept.given_up[0].why


def test_an_axis_whose_position_drifts_is_judged_by_its_velocity(records, monkeypatch):
    """What is left unsteady gives a name up, unless it takes much off the simulation's error; positions of an
    axis that nothing holds err with every model."""
    learn, judge = ([knocked_readings(one, seed) for one in kind] for seed, kind in enumerate(records))
    result = found(DRAG, learn)
    monkeypatch.setattr(objections, "all_the_time", lambda *_: False)
    drifts = {False: (20.0, 50.0), True: (30.0, 90.0)}
    kept, doubt, _ = doubted(result, learn, judge, lambda model: drifts[bool(model.effects)], borne_out)
    assert doubt is None and kept.choices == result.choices
    kept, doubt, _ = doubted(result, learn, judge, lambda model: drifts[bool(model.effects)][:1], borne_out)
    assert kept.choices == () and "at some times" in doubt.why
    assert [one.found.effect.effect for one in kept.given_up] == ["quadratic_drag"]
    assert "at some times" in kept.given_up[0].why


def test_what_is_left_of_a_right_model_is_white_and_of_a_wrong_one_is_not():
    n = 12000
    rng = np.random.default_rng(3)
    clean = recorded(STAGE, 0.1, 3)
    fit = fit_from_scratch(STAGE, [clean])
    # Chi-square of 25 degrees of freedom: mean 25, standard deviation 7.
    assert colour(fit, [clean]) < 25.0 + 6.0 * 7.0
    steps = np.repeat(rng.choice([-1.0, 1.0], n // 5), 5)[: len(clean)]
    disturbed = replace(clean, measured=clean.measured + 3e-5 * np.column_stack([steps, steps]))
    assert colour(fit, [disturbed]) > 200.0


def test_a_structure_that_leaves_colour_is_no_match_even_without_a_name(records):
    result = found(DRAG, records[0])
    unnamed = SearchResult(result.baseline, result.baseline, (), (), result.scales)
    _, doubt, _ = doubted(unnamed, *records, unimpressed, borne_out)
    assert doubt.choice is None


def knocked(seed, torque):
    """A record of a joint whose motor is knocked eight times for 40 ms, and nobody commanded it."""
    seconds, per_sample = 12.0, 40
    rng = np.random.default_rng(seed)
    pushed = np.zeros(round(seconds / DT))
    for start in rng.integers(500, len(pushed) - 100, 8):
        pushed[start : start + round(0.04 / DT)] += rng.choice([-1.0, 1.0]) * torque
    now = iter(np.repeat(pushed, per_sample))
    return joint_record(seed, seconds=seconds, motor_torque=lambda q: next(now))


def test_what_acts_at_times_is_no_match_and_takes_no_other_name():
    for torque, expected in ((0.0, False), (0.03, True)):
        learn, judge = [knocked(5, torque)], [knocked(6, torque)]
        baseline = fit_from_scratch(MODEL, learn)
        assert (unsteadiness([(baseline, learn)]) > 1.4) == expected
        result = SearchResult(baseline, baseline, (), (), recording_scales(MODEL, learn))
        doubt = doubted(result, learn, judge, unimpressed, borne_out)[1]
        assert (doubt is not None) == expected
        if expected:
            assert "at some times" in doubt.why
    # A mode explains a little of the knocks' ringing, and leaves them as they are.
    values = {"frequency": 20.0, "damping_ratio": 0.02, "inertia": 1e-3}
    mode = Effect("extra_flexible_mode", "stage1_arm", values)
    fit = fit_whole(MODEL.with_effects(mode), baseline.noise, learn, iterations=10)
    choice = Choice(Explanation(fit, 50.0, 50.0, True, 0), 1.0)
    result = SearchResult(baseline, fit, (choice,), (), recording_scales(MODEL, learn))
    kept, doubt, _ = doubted(result, learn, judge, unimpressed, borne_out)
    assert kept.choices == ()
    assert doubt.choice is choice


def test_rounding_of_an_axis_that_hardly_moves_does_not_come_and_go():
    # An arm that creeps over its encoder's coarse steps for half of the time.
    record = joint_record(7, seconds=12.0)
    fit = fit_from_scratch(MODEL, [record])
    time, step = DT * np.arange(len(record)), 2.5e-4
    creeping = np.where(time < 6.0, 1e-4 * time, 6e-4 + 0.1 * (time - 6.0))
    arm = np.rint(creeping / step) * step - creeping
    coarse = replace(record, measured=record.measured + np.column_stack([0.0 * arm, arm]))
    assert unsteadiness([(fit, [coarse])]) > 1.4  # as if its steps were not known
    known = replace(coarse, resolution=(record.resolution[0], step))
    assert unsteadiness([(fit, [known])]) < 1.2


def test_an_axis_without_an_arm_encoder_is_as_steady_as_its_motor():
    record = joint_record(8)
    alone = replace(record, measured=record.measured * np.array([1.0, np.nan]))
    fit = fit_from_scratch(MODEL, [alone])
    assert 0.3 < unsteadiness([(fit, [alone])]) < 1.2
    # Innovations that are all nought come and go neither.
    still = replace(alone, input=np.zeros(len(alone)), measured=np.zeros((len(alone), 2)))
    assert unsteadiness([(fit, [still])]) == 0.0


def test_an_effect_of_another_size_on_other_recordings_is_given_up(records):
    # A constant torque that is there on one day and turned round on the other is none.
    up, down = (
        recorded(STAGE.with_effects(Effect("constant_torque", "stage1_motor", {"torque": t})), 0.1, 4)
        for t in (0.05, -0.05)
    )
    named = found(Effect("constant_torque", "stage1_motor", {"torque": 0.02}), [up])
    assert doubted(named, [up], [up], unimpressed, borne_out)[1] is None
    _, doubt, _ = doubted(named, [up], [down], unimpressed, borne_out)
    assert "another torque" in doubt.why


def test_where_a_name_falls_the_next_of_those_it_was_not_told_from_is_asked(records):
    wrong = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})
    result, right = found(wrong, records[0]), found(DRAG, records[0]).choices[0].chosen
    (first,) = result.choices
    unsure = replace(first, confidence=0.5, others=((right, 0.3),))
    kept, doubt, _ = doubted(replace(result, choices=(unsure,)), *records, unimpressed, borne_out)
    assert doubt is None
    assert kept.choices[0].chosen is right
    assert kept.choices[0].confidence == pytest.approx(1.0)
    assert kept.final is right.fit


def test_what_is_said_is_what_spoke_against_the_first_name(records):
    wrong = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})
    worse = Effect("constant_torque", "stage1_motor", {"torque": 0.01})
    result, other = found(wrong, records[0]), found(worse, records[0]).choices[0].chosen
    (first,) = result.choices
    unsure = replace(first, confidence=0.5, others=((other, 0.3),))
    kept, doubt, _ = doubted(replace(result, choices=(unsure,)), *records, unimpressed, borne_out)
    assert kept.choices == ()
    assert doubt.choice is unsure
    assert "coulomb_friction" in doubt.why


def test_what_simulates_unseen_velocities_worse_than_their_mean_is_no_match():
    good = {"stage1_motor.velocity": 40.0, "stage1_arm.velocity": 0.5, "stage1_arm.position": -300.0}
    assert off_the_mark(good) is None  # angles drift in open loop
    found = off_the_mark({**good, "stage1_arm.velocity": -98.0})
    assert found is not None and "stage1_arm.velocity" in found.why and "signs" in found.why


def test_a_twin_is_not_asked_again():
    explanations = [
        Explanation(None, gain, 5.0, True, 0)
        for gain in (30.0, 30.0, 25.0)  # the second: the same fit
    ]
    first, twin, other = explanations
    left = _without_last([Choice(first, 0.5, ((twin, 0.3), (other, 0.2)))])
    assert [c.chosen.gain for c in left] == [25.0]
    assert left[0].confidence == 1.0
    assert _without_last([Choice(first, 0.6, ((twin, 0.4),))]) == []
    assert _without_last([Choice(first, 0.9, ((other, 0.1),))]) == []  # it was not in doubt which


def test_a_slow_drift_stands_out_by_its_rate():
    """Its change and its time constant are known together only, and on either recording as one likes."""
    drift = Effect("gain_drift", "stage1_actuator", {"change": -0.1, "time_constant": 30.0})
    estimation, validation = [recorded(STAGE.with_effects(drift), 0.2, s) for s in (1, 2)]
    result = found(drift, [estimation])
    stand = stand_of(result, (25.0, 25.0), [estimation], [validation])
    (choice,) = result.choices
    assert stands_out(choice, result.final, stand, [validation])
    head = "stage1_actuator.gain_drift."
    spread = {**stand.spread, head + "change": 1.0}
    assert stands_out(choice, result.final, replace(stand, spread=spread), [validation])
    # Where the other recordings know nothing of it, no shape helps.
    clean = recorded(STAGE, 0.2, 3)
    assert not stands_out(choice, result.final, replace(stand, spread=spread), [clean])


def test_a_limit_that_may_be_anything_does_not_stand_out():
    """A limit is none where it is infinite; every finite one differs from that by more than any error."""
    limit = Effect("torque_saturation", "stage1_actuator", {"limit": 0.25})
    estimation, validation = [recorded(STAGE.with_effects(limit), 0.2, s) for s in (1, 2)]
    result = found(limit, [estimation])
    stand = stand_of(result, (25.0, 25.0), [estimation], [validation])
    assert stands_out(result.choices[0], result.final, stand, [validation])
    size = result.final.model.parameter_values()["stage1_actuator.torque_saturation.limit"]
    for share, stands in ((0.4, True), (0.6, False)):
        apart = replace(stand, spread={"stage1_actuator.torque_saturation.limit": share * size})
        assert stands_out(result.choices[0], result.final, apart, [validation]) == stands


def test_recordings_that_hardly_determine_a_size_do_not_spread_it(records):
    estimation, _ = records
    faint = [recorded(STAGE.with_effects(DRAG), 0.004, 5)]
    result = found(DRAG, estimation)
    stand = stand_of(result, (30.0, 30.0), estimation, faint)
    assert stand.spread["stage1_motor.quadratic_drag.coefficient"] == 0.0
    assert stands_out(result.choices[0], result.final, stand, faint)


@pytest.mark.long
def test_a_finding_that_spoils_the_simulation_leaves_something_unknown(monkeypatch):
    truth = STAGE.with_effects(DRAG)
    data = [
        load_dataset(stage_recording(truth, seed=seed, seconds=10.0, rms=rms, band=(0.2, 4.0)), STAGE)
        for seed, rms in ((1, 0.2), (2, 0.15))
    ]

    def bare(result, *_):
        return replace(result, choices=(), final=result.baseline, last_round=())

    def in_vain(model, fit, *_, **__):
        return SearchResult(fit, fit, (), (), recording_scales(STAGE, records_of(data)))

    monkeypatch.setattr(explaining, "unharmful", bare)
    monkeypatch.setattr(explaining, "search_by_simulation", in_vain)
    monkeypatch.setattr(questioning, "believed_instead", lambda *_, **__: False)
    result, verdict, _, content = diagnosis.diagnose(STAGE, data[:1], data[1:])
    assert result.choices == ()
    assert verdict.kind == "unknown"
    assert "quadratic_drag" in content["doubt"]
    assert "simulated worse" in content["doubt"]
    assert verdict.where[0]["equation"] == "stage1_motor"
    # There is something left to find out.
    assert verdict.where[0]["condition"] in content["next_experiment"]["why"]


def asked_beside(second_method, named):
    """What is left of findings beside a second method, and what the recordings say of neither."""
    nothing = dict.fromkeys(("chosen_by", "simulated")) | {"learn": [], "judge": [], "cutoff": 1.0}
    horizons = SimpleNamespace(errors=lambda _: (0.1, 0.1))
    explained = SimpleNamespace(
        second_method=second_method, horizons=horizons, errors=horizons.errors, given=STAGE, **nothing
    )
    return questioning.questioned(explained, named, named, [])[0]


@pytest.mark.parametrize(
    ("nameless", "given_up", "stands"), [(False, True, True), (True, True, False), (False, False, False)]
)
def test_a_name_that_is_given_up_brings_up_the_next_but_physics_without_a_name_stays(
    monkeypatch, records, nameless, given_up, stands
):
    """Asked with a second method that would stand: it does in place of a name, not of an answer."""
    named = found(DRAG, records[0])
    choice = named.choices[0]
    bare = replace(named, choices=(), final=named.baseline, nameless=choice if nameless else None)
    doubt = Doubt(choice if given_up else None, "not it")
    stand = Stand((), (), {})
    monkeypatch.setattr(questioning, "doubted", lambda *_: (bare, doubt, stand))
    monkeypatch.setattr(questioning, "misread", lambda result, *_: (result, None))
    monkeypatch.setattr(questioning, "believed_instead", lambda *_: False)
    monkeypatch.setattr(questioning, "stands_next", lambda *_: True)
    monkeypatch.setattr(questioning, "as_result", lambda *_: ("the second method", None))
    result = asked_beside(object(), named)
    assert (result == "the second method") == stands


@pytest.mark.parametrize(
    ("std", "names", "explains", "other", "stands"),
    [
        (10.0, 1, True, None, True),
        (0.01, 1, True, None, False),
        (10.0, 2, True, None, False),
        (10.0, 1, False, None, False),
        (10.0, 1, True, 10.0, True),
        (10.0, 1, True, 0.01, False),  # what else it may be has a known size
    ],
)
def test_a_torque_whose_size_is_not_known_gives_way_to_no_more_names_that_explain_nearly_all(
    monkeypatch, records, std, names, explains, other, stands
):
    named = found(DRAG, records[0])
    choice = named.choices[0]
    size = f"{DRAG.location}.{DRAG.effect}.coefficient"
    coefficient = choice.chosen.effect.values["coefficient"]
    told, rival = (replace(choice.chosen, std={size: (s or 0.0) * coefficient}) for s in (std, other))
    others = () if other is None else ((rival, 0.4),)
    named = replace(named, choices=(replace(choice, chosen=told, others=others),))
    monkeypatch.setattr(questioning, "doubted", lambda *_: (named, None, Stand((), (), {})))
    monkeypatch.setattr(questioning, "misread", lambda result, *_: (result, None))
    monkeypatch.setattr(questioning, "left_is_random", lambda *_: True)
    monkeypatch.setattr(questioning, "beyond_reach", lambda *_: None)
    monkeypatch.setattr(questioning, "believed_instead", lambda *_: False)
    monkeypatch.setattr(questioning, "stands_next", lambda *_: explains)
    monkeypatch.setattr(questioning, "as_result", lambda _, bare, *__: (bare, None))
    group = SimpleNamespace(effects=(DRAG,) * names)
    result = asked_beside(SimpleNamespace(chosen=SimpleNamespace(group=group)), named)
    assert ["a size among these names is not known" in one.why for one in result.given_up] == [True] * stands


@pytest.mark.parametrize("first_too", [False, True])
def test_what_came_before_a_name_that_needs_another_machine_stays_unless_it_does_too(
    monkeypatch, records, first_too
):
    named = found(DRAG, records[0])
    first, second = named.choices[0], replace(named.choices[0], confidence=0.9)
    far = Doubt(first, "the bound of what is taken for possible")
    monkeypatch.setattr(questioning, "doubted", lambda *_: (named, None, Stand((), (), {})))
    monkeypatch.setattr(questioning, "misread", lambda result, *_: (result, None))
    least = 0 if first_too else 1
    monkeypatch.setattr(questioning, "beyond_reach", lambda one, _: far if one.choices[least:] else None)
    monkeypatch.setattr(questioning, "left_is_random", lambda *_: True)
    monkeypatch.setattr(questioning, "stand_of", lambda *_: Stand((), (), {}))
    named = replace(named, choices=(first, second))
    result = asked_beside(None, named)
    assert result.choices == (() if first_too else (first,))
    assert len(result.given_up) == 1 + first_too


@pytest.mark.parametrize(("gain", "expected"), [(35.0, False), (45.0, True)])
def test_what_gains_far_more_than_chance_and_only_here_is_something_unknown(records, gain, expected):
    quiet = [recorded(STAGE, 0.15, 7)], [recorded(STAGE, 0.15, 8)]
    baseline = fit_from_scratch(STAGE, quiet[0])
    chosen = found(DRAG, records[0]).choices[0].chosen
    tried = replace(chosen, gain=gain, held_out=-50.0)
    result = SearchResult(baseline, baseline, (), (tried,), recording_scales(STAGE, quiet[0]))
    _, doubt, _ = doubted(result, *quiet, unimpressed, borne_out)
    assert (doubt is not None) == expected
    if doubt is not None:
        assert doubt.choice.chosen is tried
        assert "quadratic_drag" in doubt.why
    # One that is too small to matter is none.
    nothing = replace(result, last_round=(replace(tried, material=False),))
    assert doubted(nothing, *quiet, unimpressed, borne_out)[1] is None


def test_innovations_of_many_encoder_steps_are_not_coloured_by_rounding(monkeypatch, records):
    result = found(DRAG, records[0])
    both = [(result.baseline, records[0]), (result.baseline, records[1])]
    here = in_steps(*both[0])
    finer = [replace(r, resolution=tuple(0.1 * s for s in r.resolution)) for r in records[0]]
    assert in_steps(result.baseline, finer) == pytest.approx(10.0 * here, rel=0.05)
    # A bad model makes recordings with nothing hidden as coloured as the real ones.
    monkeypatch.setattr(coloured, "expected_colour", lambda *_: 500.0)
    for steps, by_steps in ((0.5, True), (5.0, False)):
        monkeypatch.setattr(coloured, "in_steps", lambda *_, s=steps: s)
        assert coloured.by_steps((600.0, 700.0), both) == by_steps


@pytest.mark.parametrize(
    ("noise_model_fails", "stands"), [(False, "quadratic_drag"), (True, "spring_to_ground")]
)
def test_white_innovations_are_believed_against_a_free_run_that_errs_a_fifth_less(
    monkeypatch, noise_model_fails, stands
):
    """A dead zone of 11000 nats gave way to a friction that simulated better by chance."""
    data = [
        load_dataset(stage_recording(STAGE, seed=seed, seconds=4.0, band=(0.2, 4.0)), STAGE)
        for seed in (1, 2)
    ]
    learn = records_of(data[:1])
    spring = Effect("spring_to_ground", "stage1_motor", {"stiffness": 0.01, "rest": 0.0})
    predicted, free = found(DRAG, learn), found(spring, learn)

    def errors(horizons, model):
        return (0.025, 0.156 if model is free.final.model else 0.196)

    monkeypatch.setattr(explaining, "POOR_FIT", 101.0)
    monkeypatch.setattr(explaining, "search", lambda *_, **__: predicted)
    monkeypatch.setattr(explaining, "search_by_simulation", lambda *_, **__: free)
    monkeypatch.setattr(explaining, "unharmful", lambda result, percent: result)
    monkeypatch.setattr(explaining.Horizons, "errors", errors)
    monkeypatch.setattr(explaining, "coloured", lambda *_: noise_model_fails)
    told = explaining.explain(STAGE, data[:1], data[1:], lambda text: None)
    assert [c.chosen.effect.effect for c in told.kept.choices] == [stands]
    assert told.freely == noise_model_fails
