"""Names of one and the same thing: all are put up for choice, and they are the same to the recordings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import DT, ELASTIC, RIGID, drive, record

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import candidates
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.hypotheses.twins import twins, with_twins
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import likelihood_of
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.whole_fit import noise_starts

FINE = 50


def late_pendulum(late):
    """A mass with damping whose torque, or whose reading, is late by ``late`` s: one integration, shifted."""
    torque = np.repeat(drive(2, 1.0), FINE)
    torque = np.concatenate([np.zeros(round(late / DT * FINE)), torque])[: len(torque)]
    q = v = 0.0
    angles = np.empty(len(torque))
    for k, acting in enumerate(torque):
        angles[k] = q
        v += DT / FINE * (acting - 0.5 * v - 2.0 * np.sin(q)) / 0.14
        q += DT / FINE * v
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
