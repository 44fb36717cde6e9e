"""The choice among explanations: which stands up, which others remain possible, and when nothing is said."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, explanation, fit_of, joint_record

import haptic_teleop_sysid.diagnosis.decision.search.rounds as search_module
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.search.decide import choose
from haptic_teleop_sysid.diagnosis.decision.search.explore import _Trials
from haptic_teleop_sysid.diagnosis.evidence.certainty import standard_errors
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation


def test_a_clean_recording_yields_no_choice():
    assert choose([], 0.0, False) is None
    assert choose([explanation("coulomb_friction", 4.0, 1.0)], 0.0, False) is None


def test_an_effect_that_gains_only_where_it_was_fitted_is_refused():
    assert choose([explanation("coulomb_friction", 500.0, -4.0)], 0.0, False) is None
    assert choose([explanation("coulomb_friction", 5.9, 500.0)], 0.0, False) is None


def test_a_stop_that_the_other_recordings_never_reached_is_found_all_the_same():
    stop = explanation("hard_stop", 300.0, 0.1, place="arm", angle=0.2, stiffness=50.0)
    assert choose([stop], 0.0, False).chosen is stop


def test_what_was_sought_over_many_values_has_to_gain_more():
    plain = explanation("coulomb_friction", 17.9, 35.6)
    sought = {"torque": 0.001, "amplitude": 0.0004, "order": 137.0, "phase": -0.4}
    varied = explanation("position_dependent_friction", 25.1, 31.7, **sought)
    choice = choose([varied, plain], 0.0, False)
    assert choice.chosen is plain
    assert plain.gain + plain.held_out - plain.score == 2.0
    assert varied.gain + varied.held_out - varied.score == 10.0


def test_a_richer_form_that_gains_no_more_than_the_plain_one_is_no_rival():
    plain = explanation("coulomb_friction", 6443.0, 4286.6)
    dip = {"coulomb": 0.05, "breakaway": 0.06, "velocity": 0.0007}  # slower than anything in the recordings
    choice = choose([explanation("stribeck_friction", 6444.1, 4286.0, **dip), plain], 0.0, False)
    assert choice.chosen is plain and choice.confidence == 1.0 and choice.others == ()
    better = explanation("stribeck_friction", 6460.0, 4296.0, **dip)
    assert choose([better, plain], 0.0, False).ambiguous, "one that gains a little more is a rival"
    elsewhere = explanation("stribeck_friction", 6444.1, 4286.0, "arm", **dip)
    assert choose([elsewhere, plain], 0.0, False).ambiguous, "and so is one at another place"


def test_what_promised_as_much_as_the_best_is_fitted_however_much_else_was_ahead():
    def ended(one, nats):
        return replace(one.fit, log_likelihood=nats)

    friction = explanation("coulomb_friction", 110.0, -60.0)  # which the other recordings refuse
    delay = explanation("input_delay", 34.0, 5.0, "actuator", delay=0.004)
    lag = explanation("actuator_lag", 33.0, 5.0, "actuator", time_constant=0.004)
    late = explanation("sensor_delay", 30.0, 5.0, "motor_encoder", delay=0.004)
    skew = explanation("channel_skew", 34.0, 5.0, "actuator", delay=-0.004)  # the delay by another name
    ends = {180.0: friction, 134.0: delay, 133.9: skew, 130.0: lag, 128.0: late}
    one = [ended(e, nats) for nats, e in ends.items()]
    other = [ended(friction, 80.0), ended(late, 79.0)]  # without a trial of the delay
    (more,) = _Trials([], [one, other], [], friction.fit).as_promising(delay, [friction.fit, delay.fit])
    assert more is one[3]
    # Where its own trial went astray others are no measure of it.
    other.append(ended(delay, 10.0))
    both = _Trials([], [other, one], [], friction.fit)
    assert both.as_promising(delay, [friction.fit]) == [one[3]]
    assert both.as_promising(delay, [friction.fit, lag.fit]) == []
    assert both.as_promising(explanation("gravity", 40.0, 9.0, "arm", torque=0.1, phase=0.0), []) == []


def test_where_derivatives_overflowed_nothing_is_significant():
    found = explanation("coulomb_friction", 500.0, 500.0)
    names = ("stage1_motor.coulomb_friction.torque",)
    known = replace(found.fit, free=names, information=np.array([[1e8]]))
    assert choose([replace(found, fit=known)], 0.0, False) is not None
    for overflowed in (np.nan, np.inf):
        fit = replace(known, information=np.array([[overflowed]]))
        assert standard_errors(fit) == {names[0]: np.inf}
        assert choose([replace(found, fit=fit)], 0.0, False) is None


def test_a_slow_drift_differs_from_none_although_only_its_rate_is_known():
    drift = explanation("gain_drift", 60.0, 30.0, "actuator", change=-0.06, time_constant=50.0)
    head = "stage1_actuator.gain_drift."
    names = (head + "change", head + "time_constant", "motor_damping")
    # All that shows of it is change / time_constant, to a tenth.
    by_rate = np.array([1.0 / 50.0, 0.06 / 50.0**2, 0.0]) / (0.1 * 0.06 / 50.0)
    information = np.outer(by_rate, by_rate) + np.diag([1e-6, 1e-6, 100.0])
    fit = replace(drift.fit, free=names, information=information)
    assert standard_errors(fit)[names[0]] > 0.06
    assert choose([replace(drift, fit=fit)], 0.0, False) is not None
    # A structure's parameter that could make up for it takes its significance.
    by_rate[2] = 1.0
    fit = replace(fit, information=np.outer(by_rate, by_rate) + np.diag([1e-6, 1e-6, 1e-6]))
    assert choose([replace(drift, fit=fit)], 0.0, False) is None


def test_a_factor_that_may_be_nought_is_no_factor():
    found = explanation("encoder_scale", 60.0, 30.0, "motor_encoder", scale=0.2)
    names = ("stage1_motor_encoder.encoder_scale.scale",)
    for error, chosen in ((0.1, False), (0.05, True)):
        fit = replace(found.fit, free=names, information=np.array([[error**-2]]))
        assert (choose([replace(found, fit=fit)], 0.0, False) is not None) == chosen


def test_a_limit_is_significant_where_there_was_none():
    found = explanation("torque_saturation", 60.0, 30.0, "actuator", limit=2.0)
    fit = replace(found.fit, free=("stage1_actuator.torque_saturation.limit",), information=np.eye(1))
    assert choose([replace(found, fit=fit)], 0.0, False) is not None


def test_a_weak_second_effect_may_be_in_doubt_of_its_form_but_not_of_its_place():
    forms = [
        explanation("gravity", 60.0, 40.0, "arm", torque=0.1),
        explanation("spring_to_ground", 60.0, 40.0, "arm", stiffness=0.1),
    ]
    weak = 2500.0  # of which a hundred are four percent
    assert choose(forms, weak, False).ambiguous
    elsewhere = explanation("encoder_scale", 60.0, 40.0, "arm_encoder", scale=1.01)
    assert choose([forms[0], elsewhere], weak, False) is None


def test_a_limit_is_not_significant_either_where_derivatives_overflowed():
    found = explanation("torque_saturation", 60.0, 30.0, "actuator", limit=2.0)
    names = ("stage1_actuator.torque_saturation.limit",)
    fit = replace(found.fit, free=names, information=np.array([[np.nan]]))
    assert choose([replace(found, fit=fit)], 0.0, False) is None


def test_of_what_nothing_is_known_the_error_is_infinite_and_that_of_the_rest_is_not():
    found = explanation("coulomb_friction", 60.0, 30.0)
    names = ("motor_damping", "stage1_motor.coulomb_friction.torque")
    fit = replace(found.fit, free=names, information=np.array([[-1e-12, 30.0], [30.0, 1e8]]))
    assert standard_errors(fit) == {names[0]: np.inf, names[1]: pytest.approx(1e-4)}
    assert choose([replace(found, fit=fit)], 0.0, False) is not None


def test_a_name_of_no_significance_keeps_what_has_none_from_the_second_place_but_not_the_first():
    nameless = explanation("steep_drag", 300.0, 100.0, coefficient=0.1)
    names = ("stage1_motor.quadratic_drag.coefficient",)
    near = explanation("quadratic_drag", 300.0, 95.0, coefficient=0.1)
    near = replace(near, fit=replace(near.fit, free=names, information=np.array([[1e-9]])))
    assert choose([nameless, near], 0.0, False).unnamed
    assert choose([nameless, near], 500.0, False) is None


def test_an_immaterial_effect_is_refused():
    assert choose([explanation("coulomb_friction", 500.0, 500.0, is_material=False)], 0.0, False) is None


def test_a_clear_winner_is_named_alone():
    choice = choose(
        [explanation("coulomb_friction", 400.0, 400.0), explanation("constant_torque", 100.0, 100.0)],
        0.0,
        False,
    )
    assert choice is not None
    assert choice.chosen.effect.effect == "coulomb_friction"
    assert choice.confidence == pytest.approx(1.0, abs=0.01)
    assert not choice.ambiguous
    assert choice.others == ()


def test_one_effect_that_was_found_twice_is_no_rival_of_itself():
    lag = explanation("actuator_lag", 300.0, 200.0, "actuator", time_constant=0.01)
    again = replace(lag, gain=299.9, by_current=100.0)
    choice = choose([lag, again], 0.0, False)
    assert choice.chosen is lag
    assert choice.confidence == pytest.approx(1.0)
    assert choice.others == ()


def test_an_exact_tie_is_ambiguous_and_names_both():
    choice = choose(
        [explanation("coulomb_friction", 300.0, 200.0), explanation("constant_torque", 300.0, 200.0)],
        0.0,
        False,
    )
    assert choice is not None
    assert choice.ambiguous
    assert choice.confidence == pytest.approx(0.5)
    (other, share), *rest = choice.others
    assert {choice.chosen.effect.effect, other.effect.effect} == {"coulomb_friction", "constant_torque"}
    assert share == pytest.approx(0.5)
    assert rest == []


def test_a_weak_second_effect_is_refused():
    weak = explanation("coulomb_friction", 60.0, 40.0)
    assert choose([weak], 0.0, False) is not None
    assert choose([weak], 10000.0, False) is None


def test_a_weak_second_effect_that_follows_another_joint_is_no_leftover():
    coupling = explanation("inertial_coupling", 100.0, 100.0, place="arm", coefficient=0.01)
    assert choose([coupling], 10000.0, False).chosen is coupling
    assert choose([coupling], 400000.0, False) is None


def test_what_is_left_of_a_lag_is_no_wrong_stamp_beside_it():
    lag = Effect("actuator_lag", "stage1_actuator", {"time_constant": 0.05})
    skew = Effect("channel_skew", "stage1_actuator", {"delay": -0.0006})
    beside = Explanation(fit_of(MODEL.with_effects(lag, skew)), 100.0, 600.0, True, 1)
    assert choose([beside], 11000.0, False) is None
    elsewhere = Effect("channel_skew", "stage1_arm_encoder", {"delay": -0.0006})
    apart = Explanation(fit_of(MODEL.with_effects(lag, elsewhere)), 100.0, 600.0, True, 1)
    assert choose([apart], 11000.0, False) is not None


def test_what_predicts_the_same_as_a_leftover_is_one_too():
    """A beam with a propeller that never stops: a constant torque beside its gravity was a leftover of the
    thrust's curve, and a dead zone that is the same there had no share to reach, at 77 %."""
    gravity = Effect("gravity", "stage1_motor", {"torque": 1.0, "phase": 1.6})
    constant = Effect("constant_torque", "stage1_motor", {"torque": -0.3})
    zone = Effect("dead_zone", "stage1_actuator", {"width": 0.3})
    left, same = (
        Explanation(fit_of(MODEL.with_effects(gravity, one)), 24.0, held_out, True, 1)
        for one, held_out in ((constant, 3.3), (zone, 3.2))
    )
    assert choose([left], 480.0, False, apart=lambda *_: 0.1) is None
    assert choose([left, same], 480.0, False, apart=lambda *_: 0.1) is None
    assert choose([left, same], 480.0, False, apart=lambda *_: 30.0).chosen is same
    clearer = replace(same, gain=40.0)
    assert choose([left, clearer], 480.0, False, apart=lambda *_: 0.1).chosen is clearer


def test_a_current_that_follows_its_command_speaks_against_a_wrong_stamp():
    tie = [
        explanation("channel_skew", 300.0, 200.0, "actuator", delay=0.01),
        explanation("input_delay", 300.0, 200.0, "actuator", delay=0.01),
    ]
    unknown, follows = choose(tie, 0.0, False), choose(tie, 0.0, True)
    assert unknown is not None and follows is not None
    assert unknown.ambiguous
    assert follows.chosen.effect.effect == "input_delay"
    assert follows.confidence > unknown.confidence
    assert not follows.ambiguous


def test_what_the_recordings_are_not_expected_to_tell_apart_is_one_set():
    delay = explanation("input_delay", 37.0, 6.0, "actuator", delay=0.008)
    lag = explanation("actuator_lag", 33.0, 6.0, "actuator", time_constant=0.008)
    alone = choose([delay, lag], 0.0, True, apart=lambda one, other: 20.0)
    assert alone.chosen is delay and not alone.ambiguous
    both = choose([delay, lag], 0.0, True, apart=lambda one, other: 3.0)
    assert both.chosen is delay and both.ambiguous
    assert [e.effect.effect for e, _ in both.others] == ["actuator_lag"]
    # What was found all the same: chance would have had to favour it too much.
    behind = explanation("actuator_lag", 30.0, 6.0, "actuator", time_constant=0.008)
    assert not choose([delay, behind], 0.0, True, apart=lambda one, other: 3.0).ambiguous
    # A richer form that predicts the same is none.
    plain = explanation("coulomb_friction", 37.0, 6.0)
    richer = explanation("asymmetric_friction", 35.0, 6.0, positive=0.1, negative=0.1)
    assert not choose([plain, richer], 0.0, True, apart=lambda one, other: 0.0).ambiguous
    # Beside something strong it is stated as well: that it is there is clear, and only its name is not.
    beside = [replace(e, gain=3.0 * e.gain) for e in (delay, lag)]
    behind = replace(beside[1], gain=beside[0].gain - 4.0)
    second = choose([beside[0], behind], 1000.0, True, apart=lambda *_: 3.0)
    assert second.ambiguous and not second.left_open
    # A delay and a lag that differ by nothing are open by themselves, and too weak there.
    same = choose([beside[0], replace(beside[1], gain=beside[0].gain)], 1000.0, True, apart=lambda *_: 0.0)
    assert same is None


def test_the_search_asks_on_all_recordings_how_far_two_explanations_are_apart(monkeypatch):
    fit, asked = fit_of(), []

    def choosing(found, best_so_far, sense_follows, percent, apart, further):
        asked.append(apart(fit, fit))

    monkeypatch.setattr(search_module, "explore", lambda fit, *_, **__: (fit, []))
    monkeypatch.setattr(search_module, "choose", choosing)
    monkeypatch.setattr(search_module, "nats_apart", lambda one, other, records: len(records))
    records = [joint_record(1, seconds=1.0)]
    assert search_module.search(MODEL, fit, records, 2 * records).choices == ()
    assert asked == [3]
