"""What no recording can tell apart is put up for choice together: names of one and the same thing."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import DT, MODEL, NOISE, joint_record
from stepped_machines import DT as STEP
from stepped_machines import ELASTIC, RIGID, drive, record

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.search.decide import choose
from haptic_teleop_sysid.diagnosis.evidence.certainty import standard_errors
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import candidates
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.hypotheses.twins import twins, with_twins
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import innovations, likelihood_of
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.whole_fit import noise_starts


@pytest.mark.parametrize(
    ("effect", "place", "delay", "other", "others_delay"),
    [
        ("sensor_delay", "arm_encoder", 0.003, "channel_skew", 0.003),
        ("channel_skew", "motor_encoder", 0.003, "sensor_delay", 0.003),
        ("input_delay", "actuator", 0.004, "channel_skew", -0.004),
        ("channel_skew", "actuator", -0.004, "input_delay", 0.004),
    ],
)
def test_a_delay_and_a_stamp_are_twins(effect, place, delay, other, others_delay):
    found = twins(Effect(effect, f"stage1_{place}", {"delay": delay}), rigid=False)
    assert found == [Effect(other, f"stage1_{place}", {"delay": others_delay})]


@pytest.mark.parametrize(
    ("effect", "place", "parameters"),
    [
        ("channel_skew", "arm_encoder", {"delay": -0.003}),
        ("channel_skew", "actuator", {"delay": 0.004}),
        ("actuator_lag", "actuator", {"time_constant": 0.004}),
    ],
)
def test_what_comes_too_early_has_no_twin(effect, place, parameters):
    assert twins(Effect(effect, f"stage1_{place}", parameters), rigid=False) == []


def test_a_twin_predicts_the_same_and_both_are_named():
    record = joint_record(4)
    model = MODEL.with_effects(Effect("input_delay", "stage1_actuator", {"delay": 2.3 * DT}))
    names = model.free_parameters()
    information = 1e10 * (np.diag(np.arange(1.0, len(names) + 1.0)) + 0.1)
    fit = Fit(model, NOISE, names, 0.0, information, np.ones(len(names)), True, 1, "as given")
    both = with_twins([Explanation(fit, 300.0, 200.0, True, 0)])
    assert [e.effect.effect for e in both] == ["input_delay", "channel_skew"]
    errors = [innovations(pack(e.fit.model), NOISE, record).innovation for e in both]
    # What was commanded before the record begins and after its end is not there.
    inner = slice(250, -3)
    np.testing.assert_allclose(errors[0][inner], errors[1][inner], atol=1e-3 * np.std(errors[0]))
    stds = [list(standard_errors(e.fit).values()) for e in both]
    np.testing.assert_allclose(stds[0], stds[1])
    assert both[1].fit.free == both[1].fit.model.free_parameters()
    assert choose(both, 0.0, False).ambiguous
    assert with_twins(both) == both


def test_a_twin_that_was_fitted_less_well_has_the_better_one_s_fit():
    """A search that ends a little short of the best was a name less, though no recording tells them apart."""
    none = np.zeros((0, 0))

    def told(effect, delay, gain, by_current=0.0):
        model = MODEL.with_effects(Effect(effect, "stage1_motor_encoder", {"delay": delay}))
        fit = Fit(model, NOISE, (), 0.0, none, np.zeros(0), True, 1, "as given")
        return Explanation(fit, gain, gain, True, 0, by_current=by_current)

    better, worse = told("channel_skew", 0.004, 200.0), told("sensor_delay", 0.003, 190.0)
    for found in ([better, worse], [worse, better]):
        same = {e.effect.effect: (e.effect.parameters["delay"], e.gain) for e in with_twins(found)}
        assert same == {"channel_skew": (0.004, 200.0), "sensor_delay": (0.004, 200.0)}
    shown = told("sensor_delay", 0.003, 190.0, by_current=50.0)
    assert with_twins([better, shown]) == [better, shown]


FINE = 50


def late_pendulum(late):
    """A mass with damping whose torque, or whose reading, is late by ``late`` s: one integration, shifted."""
    torque = np.repeat(drive(2, 1.0), FINE)
    torque = np.concatenate([np.zeros(round(late / STEP * FINE)), torque])[: len(torque)]
    q = v = 0.0
    angles = np.empty(len(torque))
    for k, acting in enumerate(torque):
        angles[k] = q
        v += STEP / FINE * (acting - 0.5 * v - 2.0 * np.sin(q)) / 0.14
        q += STEP / FINE * v
    return record(drive(2, 1.0), angles[::FINE, None], 1e-5)


def names(effects):
    return {(e.effect, e.location, round(e.parameters["delay"], 6)) for e in effects}


def test_what_is_late_in_a_rigid_joint_has_four_names():
    everything = {
        ("input_delay", "j_actuator", 0.013),
        ("channel_skew", "j_actuator", -0.013),
        ("channel_skew", "j_motor_encoder", 0.013),
        ("sensor_delay", "j_motor_encoder", 0.013),
    }
    for effect, location, delay in everything:
        one = Effect(effect, location, {"delay": delay})
        assert names(twins(one, rigid=True)) == everything - {(effect, location, delay)}


def test_behind_a_spring_a_late_torque_is_no_late_reading():
    def told(effect, place, delay):
        return names(twins(Effect(effect, f"j_{place}", {"delay": delay}), rigid=False))

    assert told("input_delay", "actuator", 0.01) == {("channel_skew", "j_actuator", -0.01)}
    assert told("sensor_delay", "arm_encoder", 0.01) == {("channel_skew", "j_arm_encoder", 0.01)}
    assert told("channel_skew", "motor_encoder", -0.01) == set(), "nothing is early but a stamp"


def test_no_name_is_put_up_that_the_model_has_already():
    late, skewed = (Effect(n, "j_actuator", {"delay": 0.01}) for n in ("input_delay", "channel_skew"))
    model = RIGID.with_effects(skewed, late)
    none = np.zeros((0, 0))
    fit = Fit(model, NoiseModel(1e-4, 1e-4, 1e-4, 1e-4), (), 0.0, none, np.zeros(0), True, 1, "")
    found = with_twins([Explanation(fit, 50.0, 20.0, True, 1)])
    assert [(e.effect.effect, e.effect.location) for e in found] == [
        ("input_delay", "j_actuator"),
        ("channel_skew", "j_motor_encoder"),
        ("sensor_delay", "j_motor_encoder"),
    ]


def test_what_is_late_already_is_not_looked_for_under_another_name():
    one = late_pendulum(0.004)
    both = replace(one, measured=np.repeat(one.measured[:, :1], 2, axis=1))

    def offered(model, seen):
        model = model.with_effects(Effect("input_delay", "j_actuator", {"delay": 0.01}))
        found = {(e.effect, e.location) for e in candidates(model, [seen], recording_scales(model, [seen]))}
        return {f for f in found if f[0] in ("input_delay", "sensor_delay", "channel_skew")}

    assert offered(RIGID, one) == set()
    encoders = {(n, f"j_{p}_encoder") for n in ("sensor_delay", "channel_skew") for p in ("motor", "arm")}
    assert offered(ELASTIC, both) == encoders


@pytest.mark.parametrize("late", [0.0131, 0.004])
def test_all_names_predict_the_recording_alike(late):
    one = late_pendulum(late)
    weight = Effect("gravity", "j_motor", {"torque": 2.0})
    model = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.5}).with_effects(weight)
    first = Effect("input_delay", "j_actuator", {"delay": late})
    noise = noise_starts(model, [one])[1]
    on_time = likelihood_of(pack(model), noise, [one])
    found = [
        likelihood_of(pack(model.with_effects(e)), noise, [one])
        for e in (first, *twins(first, rigid=True))
    ]
    assert min(found) > on_time + 20.0 and np.ptp(found) < 1.0
