"""Parameters and noise levels fitted at once: they arrive at the same top from anywhere, and no lower than
the truth lies."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, off
from stepped_machines import ELASTIC, RIGID, drive
from stepped_machines import record as recorded

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import innovations, log_likelihood
from haptic_teleop_sysid.estimation.noise import NoiseModel, observer_gain
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.tuning import initial_noise, level_bounds
from haptic_teleop_sysid.estimation.uncertainty import uncertainty
from haptic_teleop_sysid.estimation.whitening import whiten
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole

DT = 0.002
TRUE = NoiseModel(0.02, 0.002, 2e-5, 1e-4, motor_time=0.004, arm_time=0.05)


@pytest.fixture(scope="module")
def record():
    """A stage with coloured torques on motor and arm, integrated by the matrix exponential."""
    from scipy.linalg import expm

    p = STAGE.parameters
    ks, jm, ja = p["stiffness"], p["motor_inertia"], p["arm_inertia"]
    a = np.zeros((7, 7))
    a[0, 2] = a[1, 3] = 1.0
    a[2, :] = np.array([-ks, ks, -p["motor_damping"], 0.0, 1.0, 0.0, p["torque_constant"]]) / jm
    a[3, :] = np.array([ks, -ks, 0.0, -p["arm_damping"], 0.0, 1.0, 0.0]) / ja
    step = expm(a * DT)[:4]
    rng = np.random.default_rng(5)
    n = 6000
    current = np.repeat(rng.uniform(-0.2, 0.2, n // 20), 20)
    decay = np.array(TRUE.decay(DT))
    level = np.array([TRUE.motor_torque, TRUE.arm_torque])
    x, d = np.zeros(4), level * rng.standard_normal(2)
    measured = np.empty((n, 2))
    for k in range(n):
        measured[k] = x[:2]
        x = step @ np.r_[x, d, current[k]]
        d = decay * d + level * np.sqrt(1.0 - decay**2) * rng.standard_normal(2)
    measured += rng.standard_normal((n, 2)) * [TRUE.motor_angle, TRUE.arm_angle]
    return Record("made", DT, current, measured, np.zeros(n), (7e-5, 3.5e-4))


def likelihood(model, noise, record):
    packed = pack(model)
    return log_likelihood(packed, [record], [innovations(packed, noise, record).innovation])


def test_the_top_is_reached_from_every_start_and_lies_above_the_truth(record):
    start = initial_noise(pack(STAGE), [record])
    tops = [
        fit_whole(off(STAGE, 1), replace(start, motor_time=t, arm_time=t), [record], iterations=30)
        for t in (1.0, 0.1, 0.01)
    ]
    assert max(f.log_likelihood for f in tops) - min(f.log_likelihood for f in tops) < 1.0
    # Five parameters and five levels gain half a nat each over the truth, give or take.
    assert 0.0 < tops[0].log_likelihood - likelihood(STAGE, TRUE, record) < 20.0


@pytest.mark.parametrize("scale", [0.5, 4.0])
def test_readings_in_another_unit_are_predicted_as_well_by_a_body_in_that_unit(record, scale):
    own = {"torque_constant": 8.925, "motor_inertia": 0.07, "motor_damping": 2.0}
    body = Model("generic", "j", "rigid_body", own)
    heavier = {**own, "motor_inertia": 0.07 * scale, "motor_damping": 2.0 * scale}
    read = Effect("encoder_scale", f"{body.joint}_motor_encoder", {"scale": scale})
    plain = replace(record, measured=np.column_stack([record.measured[:, 0], np.full(len(record), np.nan)]))
    same = replace(body, parameters=heavier, effects=(read,))
    # An observer that forgets the scale corrects too much or too little, and its likelihood is another one.
    assert likelihood(same, TRUE, plain) == pytest.approx(likelihood(body, TRUE, plain), abs=0.01)


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_a_scale_at_its_bound_is_said_to_be_there(record, scale):
    read = Effect("encoder_scale", "stage1_motor_encoder", {"scale": scale})
    fit = fit_whole(STAGE.with_effects(read), TRUE, [record], iterations=0)
    found = uncertainty(fit, [record])
    assert found.undetermined["stage1_motor_encoder.encoder_scale.scale"] == "it ends at its bound"


def test_levels_come_out_as_they_were_made(record):
    found = fit_from_scratch(off(STAGE, 2), [record]).noise
    # The motor's encoder is the unit: the other levels are told relative to it.
    unit = TRUE.motor_angle / found.motor_angle
    assert found.motor_time == pytest.approx(TRUE.motor_time, rel=0.3)
    assert unit * found.motor_torque == pytest.approx(TRUE.motor_torque, rel=0.3)
    # The arm's torque and its encoder's noise are told only against each other here: both scaled alike cost
    # less than a tenth of a nat.
    assert found.arm_torque / found.arm_angle == pytest.approx(TRUE.arm_torque / TRUE.arm_angle, rel=0.3)


def test_parameters_are_less_sure_when_the_levels_are_unknown_too(record):
    whole = fit_from_scratch(STAGE, [record])
    held = fit_parameters(whole.model, whole.noise, [record])
    values, true = whole.model.parameter_values(), STAGE.parameter_values()
    errors = np.sqrt(np.diag(np.linalg.inv(whole.information)))
    for name, error in zip(whole.free, errors, strict=True):
        assert abs(values[name] - true[name]) < 4.0 * error
    assert np.all(errors > 0.8 * np.sqrt(np.diag(np.linalg.inv(held.information))))


def test_a_bound_is_kept(record):
    start = initial_noise(pack(STAGE), [record])
    kept = fit_whole(STAGE, start, [record], limits={"arm_inertia": (0.15, 0.165)})
    assert kept.model.parameters["arm_inertia"] <= 0.165
    assert "arm_inertia" in kept.at_bound


def test_decorrelated_slopes_are_those_of_the_decorrelated_innovations(record):
    random = np.random.default_rng(5)
    record = replace(record, at_rest=True)
    packed, n = pack(STAGE), len(record)
    innovation = random.standard_normal((n, 2)) @ np.array([[1e-4, 3e-5], [0.0, 2e-4]])
    slope = random.standard_normal((n, 2, 3))
    e, jacobian = whiten(packed, record, innovation, slope)
    assert e.reshape(n, 2).T @ e.reshape(n, 2) / n == pytest.approx(np.eye(2), abs=1e-9)
    step = np.array([1e-7, -2e-7, 3e-7])
    moved = whiten(packed, record, innovation + slope @ step, slope, innovation)[0]
    assert moved - e == pytest.approx(jacobian @ step, rel=1e-6, abs=1e-9)
    # Slices of a larger array, as they come where the beginning does not count.
    wide = np.zeros((n, 2, 8))
    wide[:, :, :3] = slope
    assert np.array_equal(whiten(packed, record, innovation, wide[:, :, :3])[1], jacobian)
    # Without an arm's reading the motor's innovations alone.
    lone = replace(record, measured=np.column_stack([record.measured[:, 0], np.full(n, np.nan)]))
    single = whiten(packed, lone, innovation, slope)[1]
    assert single == pytest.approx(slope[:, 0] / np.sqrt(np.mean(innovation[:, 0] ** 2)))


@pytest.mark.parametrize("resolution", [1e-2, 1e-5, 1e-13])
def test_the_observer_has_a_gain_at_every_bound_of_the_levels(resolution):
    """An angle integrated from a speed has steps of 1e-13 rad: a disturbance of 1e11 of them had none."""
    for model in (RIGID, ELASTIC):
        one = recorded(drive(0, 2.0, 4.0), np.zeros((2000, 1 if model is RIGID else 2)))
        one = replace(one, resolution=(resolution, resolution), dt=0.0103)
        packed = pack(model)
        bounds = level_bounds(packed, [one])
        for ends in itertools.product((0, 1), repeat=4):
            times = dict(zip(("motor_time", "arm_time"), ends[:2], strict=True))
            torques = dict(zip(("motor_torque", "arm_torque"), ends[2:], strict=True))
            levels = {n: bounds[n][end] for n, end in (times | torques).items()}
            noise = replace(initial_noise(packed, [one]), **levels)
            gain = observer_gain(packed, noise, one.dt)
            assert np.all(np.isfinite(gain)) and 0.0 <= gain[0, 0] < 1.001
