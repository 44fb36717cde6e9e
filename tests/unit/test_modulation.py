"""An effect that grows with something else does not keep its size, and the test says with what it grows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identification_plants import STAGE, multisine, stage_recording

from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.experiments import run_open_loop
from haptic_teleop_sim.hardware import SfjRobot
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sim.sfj_robot import SfjSettings, stage_hardware
from haptic_teleop_sysid.diagnosis.decision.name_tests import changing_size
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.evidence import modulation
from haptic_teleop_sysid.diagnosis.evidence.modulation import (
    RESTED,
    Modulation,
    changes_with,
    modulations,
    rested,
)
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.likelihood import innovations, settling
from haptic_teleop_sysid.estimation.records import record_from
from haptic_teleop_sysid.estimation.whitening import whiten
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts
from haptic_teleop_sysid.recordings.dataset import load_dataset

FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.08, "contact_angle": 1e-4})
UNEVEN = Effect(
    "position_dependent_friction",
    "stage1_motor",
    {"torque": 0.08, "amplitude": 0.07, "order": 6.0, "phase": 0.0, "contact_angle": 1e-4},
)
DRAG = Effect("quadratic_drag", "stage1_motor", {"coefficient": 2.0})


LAG = Effect("actuator_lag", "stage1_actuator", {"time_constant": 0.03})


def recorded(truth, seed):
    recording = stage_recording(
        STAGE.with_effects(truth), seed=seed, seconds=20.0, rms=0.15, band=(0.2, 4.0)
    )
    return record_from(load_dataset(recording, STAGE), commanded=True)


def recorded_with_a_lag(time_constant, seed):
    """A stage whose current follows its command with a time constant, s, of the command's size, A."""
    n, dt, now = 10_000, 0.002, 0.0
    command = multisine(n, dt, 0.15, (0.2, 4.0), seed)
    current = np.empty(n)
    for i, wanted in enumerate(command):
        now += (wanted - now) * -np.expm1(-dt / time_constant(abs(wanted)))
        current[i] = now
    robot = SfjRobot(SfjSettings(stage1=stage_hardware("stage1", STAGE, disturbance_rms=0.013)), dt, seed)
    nominal = robot.torque_constants[0]
    topics = run_open_loop(robot, np.column_stack([nominal * current, np.zeros(n)]))
    record = record_from(load_dataset(Recording(Path("lag"), topics, {}), STAGE), commanded=True)
    return replace(record, input=command)


def changing(records, named):
    """How the size of ``named`` changes, fitted to each of some recordings of a stage."""
    found = []
    for record in records:
        model = STAGE.with_effects(named)
        fits = [fit_whole(model, noise, [record], iterations=30) for noise in noise_starts(model, [record])]
        fit = max(fits, key=lambda f: f.log_likelihood)
        found.append(modulations(fit, fit.model.effects[0], [record]))
    return found


@pytest.mark.parametrize("effect", [FRICTION, DRAG])
def test_what_it_is_keeps_its_size(effect):
    here, elsewhere = changing([recorded(effect, seed) for seed in (1, 2)], effect)
    assert not changes_with(here, elsewhere, 0.1, 8.0)


def test_the_noise_of_the_same_sample_is_nothing_that_a_size_changes_with(monkeypatch):
    """A controller's output has the noise of the same sample's readings in it, as the innovation has."""
    record = recorded(FRICTION, 1)
    fit = fit_whole(STAGE.with_effects(FRICTION), noise_starts(STAGE, [record])[0], [record], iterations=5)
    packed, first = pack(fit.model), settling(record)
    run = innovations(packed, fit.noise, record, fit.free)
    errors, slopes = whiten(packed, record, run.innovation, run.d_innovation)
    size = slopes[:, fit.free.index("stage1_motor.coulomb_friction.torque")]
    noise = np.zeros(len(record))
    noise[first:] = (errors * np.sign(size)).reshape(-1, 2).sum(axis=1)
    monkeypatch.setattr(modulation, "_quantities", lambda *asked: [("noise", noise)])
    found = modulations(fit, fit.model.effects[0], [record])
    assert found["noise"].gain < 8.0


def test_friction_that_grows_with_the_angle_is_told_by_it():
    here, elsewhere = changing([recorded(UNEVEN, seed) for seed in (1, 2)], FRICTION)
    what, share = changes_with(here, elsewhere, 0.3, 30.0)[0]
    assert what == "motor angle"
    # The relative amplitude (7/8) times the spread of sin(6 q) over an angle of some tenths of a radian.
    assert 0.3 < share < 0.9


def test_a_lag_of_a_constant_time_keeps_it():
    here, elsewhere = changing([recorded_with_a_lag(lambda size: 0.03, seed) for seed in (1, 2)], LAG)
    assert not changes_with(here, elsewhere, 0.1, 8.0)


def test_a_lag_that_is_shorter_for_large_commands_is_told_by_their_size():
    records = [recorded_with_a_lag(lambda size: 0.06 / (1.0 + size / 0.1), seed) for seed in (1, 2)]
    here, elsewhere = changing(records, LAG)
    what, share = changes_with(here, elsewhere, 0.1, 20.0)[0]
    assert (what, share < 0.0) == ("size of the input", True)


@pytest.mark.parametrize(
    ("time_constant", "left"),
    [
        (lambda size: 0.03, ["actuator_lag", "quadratic_drag"]),
        (lambda size: 0.06 / (1.0 + size / 0.1), ["quadratic_drag"]),
    ],
)
def test_beside_another_name_a_lag_stays_if_its_time_is_constant(time_constant, left):
    records = [recorded_with_a_lag(time_constant, seed) for seed in (1, 2)]
    bare = fit_whole(STAGE, noise_starts(STAGE, records[:1])[0], records[:1])
    fit = fit_whole(STAGE.with_effects(LAG, DRAG), bare.noise, records[:1], iterations=30)
    choices = tuple(Choice(Explanation(fit, 50.0, 20.0, True, index), 0.9) for index in (0, 1))
    result = SearchResult(bare, fit, choices, (), recording_scales(STAGE, records))
    found = changing_size.one_size_each(result, records[:1], records[1:])
    assert [c.chosen.effect.effect for c in found.choices] == left
    assert [e.effect for e in found.final.model.effects] == left


def test_beside_other_names_friction_is_not_asked_and_what_changes_most_goes_first(monkeypatch):
    delay = Effect("input_delay", "stage1_actuator", {"delay": 0.01})
    share = {"coulomb_friction": 0.9, "actuator_lag": 0.3, "input_delay": 0.5}
    alone: list[str] = []

    def changing(fit, again, effect, estimation, validation):
        still = effect.effect == "actuator_lag" and len(fit.model.effects) < 3
        return None if still else ("time", share[effect.effect])

    def without(result, effect, records):
        alone.append(effect.effect)
        return replace(result.final, model=result.final.model.without(effect.effect, effect.location))

    monkeypatch.setattr(changing_size, "changing_with", changing)
    monkeypatch.setattr(changing_size, "without", without)
    monkeypatch.setattr(changing_size, "held_out_fit", lambda fit, records, noises: fit)
    monkeypatch.setattr(changing_size, "fitted_there", lambda fit, there, effect, validation: fit)
    record = recorded(FRICTION, 1)
    bare = fit_whole(STAGE, noise_starts(STAGE, [record])[0], [record], iterations=1)
    fit = replace(bare, model=STAGE.with_effects(FRICTION, LAG, delay))
    choices = tuple(Choice(Explanation(fit, 50.0, 20.0, True, index), 0.9) for index in range(3))
    result = SearchResult(bare, fit, choices, (), recording_scales(STAGE, [record]))
    found = changing_size.one_size_each(result, [record], [record])
    assert alone == ["input_delay"]
    assert [c.chosen.effect.effect for c in found.choices] == ["coulomb_friction", "actuator_lag"]


def test_both_kinds_of_recordings_have_to_agree():
    grows, shrinks = {"time": Modulation(0.5, 90.0)}, {"time": Modulation(-0.5, 90.0)}
    weak = {"time": Modulation(0.5, 2.0)}
    assert changes_with(grows, grows, 0.3, 30.0) == [("time", 0.5)]
    assert not changes_with(grows, shrinks, 0.3, 30.0)
    assert not changes_with(grows, weak, 0.3, 30.0)
    assert not changes_with(grows, {}, 0.3, 30.0)


def test_rests_are_counted_before_the_motion_that_follows():
    velocity = np.ones(1000)
    velocity[100:150] = 0.001  # 0.1 s at rest
    velocity[400:700] = 0.0  # longer than matters
    velocity[990:] = 0.0  # no motion follows
    expected = np.zeros(1000)
    # For 0.02 s, ten samples; the longer rest counts as one of 0.3 s.
    expected[150:160] = 0.1
    expected[700:710] = 0.3
    assert np.allclose(rested(velocity, 0.002), expected)
    assert not rested(np.ones(50), 0.002).any()


def test_what_happens_for_moments_needs_to_change_the_mean_but_little():
    ages = {RESTED: Modulation(0.02, 40.0), "time": Modulation(0.02, 40.0)}
    assert changes_with(ages, ages, 0.3, 30.0) == [(RESTED, 0.02)]
    by_chance = {RESTED: Modulation(0.02, 8.0)}
    assert not changes_with(ages, by_chance, 0.3, 30.0)


@pytest.mark.parametrize(("by_rounding", "told"), [(0.10, None), (-0.10, None), (0.01, (RESTED, 0.15))])
def test_what_the_encoders_steps_make_of_a_constant_size_is_no_change_of_it(monkeypatch, by_rounding, told):
    real, made = object(), object()
    said = {real: {RESTED: Modulation(0.15, 40.0)}, made: {RESTED: Modulation(by_rounding, 3.0)}}
    monkeypatch.setattr(changing_size, "null_records", lambda fit, records: made)
    monkeypatch.setattr(changing_size, "modulations", lambda fit, effect, records: said[records])
    assert changing_size.changing_with(None, None, FRICTION, real, real) == told
