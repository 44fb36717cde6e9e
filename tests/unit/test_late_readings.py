"""An encoder that is late by part of a sample: what the observer makes of it.

The robot is integrated here by the matrix exponential at a hundredth of the sample, with coloured torques and
quantised readings; no code of the observer is used.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.estimation.likelihood import innovations, log_likelihood
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.records import Record, thinned_to
from haptic_teleop_sysid.estimation.uncertainty import uncertainty
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole, noise_starts

DT, FINE, SAMPLES = 0.002, 100, 6000
COUNT = 1.5e-5
P = {
    "torque_constant": 1.0,
    "stiffness": 4.0,
    "motor_inertia": 0.07,
    "motor_damping": 2.5,
    "arm_inertia": 0.16,
    "arm_damping": 0.02,
}
MODEL = Model("sfj", "stage1", "flexible_joint", P, fixed=("stiffness",))
NOISE = NoiseModel(0.19, 0.03, COUNT / 12**0.5, COUNT / 12**0.5, 0.4, 0.04)


def late(model, delay, effect="sensor_delay", place="motor_encoder"):
    return model.with_effects(Effect(effect, f"stage1_{place}", {"delay": delay}))


@cache
def motion():
    """A lively command (SAMPLES,), the motor's angle a hundred times a sample, flat, the arm's once."""
    rng = np.random.default_rng(5)
    a, b = np.zeros((4, 4)), np.zeros((4, 2))
    a[0, 2] = a[1, 3] = 1.0
    ks, jm, ja = P["stiffness"], P["motor_inertia"], P["arm_inertia"]
    a[2] = [-ks / jm, ks / jm, -P["motor_damping"] / jm, 0.0]
    a[3] = [ks / ja, -ks / ja, 0.0, -P["arm_damping"] / ja]
    b[2, 0], b[3, 1] = 1.0 / jm, 1.0 / ja
    both = expm(np.block([[a, b], [np.zeros((2, 6))]]) * DT / FINE)
    ahead, push = both[:4, :4], both[:4, 4:]
    time = np.arange(SAMPLES) * DT
    command = 1.5 * np.sin(2 * np.pi * 0.7 * time) + 0.8 * rng.standard_normal(SAMPLES)
    disturbance = np.zeros(2)
    level, decay = np.array([0.19, 0.03]), np.exp(-DT / np.array([0.4, 0.04]))
    state, past, arm = np.zeros(4), np.zeros((SAMPLES, FINE)), np.empty(SAMPLES)
    for k in range(SAMPLES):
        arm[k] = state[1]
        for s in range(FINE):
            past[k, s] = state[0]
            state = ahead @ state + push @ (np.array([command[k], 0.0]) + disturbance)
        disturbance = decay * disturbance + level * np.sqrt(1 - decay**2) * rng.standard_normal(2)
    return command, past.reshape(-1), arm


def recorded(delay):
    """A motor encoder that is ``delay`` late."""
    command, motor, arm = motion()
    place = np.arange(SAMPLES) * FINE - round(delay / DT * FINE)
    read = np.column_stack([np.where(place >= 0, motor[place], 0.0), arm])
    measured = COUNT * np.round(read / COUNT)
    return Record("late", DT, command, measured, np.zeros(SAMPLES), (COUNT, COUNT), at_rest=True)


@pytest.fixture(scope="module")
def record():
    return recorded(0.0007)


def early(record, by):
    """The same readings, of which the motor's are stamped so many samples early."""
    moved = np.full_like(record.measured[:, 0], np.nan)
    moved[:-by] = record.measured[by:, 0]
    return replace(record, measured=np.column_stack([moved, record.measured[:, 1]]))


def colour(model, record):
    """Correlation of the motor's innovations from one sample to the next."""
    e = innovations(pack(model), NOISE, record).innovation[200:, 0]
    return float(np.corrcoef(e[:-1], e[1:])[0, 1])


@pytest.mark.parametrize("samples", [0.35, 0.9, 0.995])
def test_innovations_of_a_late_encoder_are_white_under_the_true_model(samples):
    record = recorded(samples * DT)
    assert abs(colour(late(MODEL, samples * DT), record)) < 4.0 / SAMPLES**0.5
    assert colour(MODEL, record) > 0.2


def test_and_those_of_one_that_is_stamped_early(record):
    assert abs(colour(late(MODEL, -0.65 * DT, "channel_skew"), early(record, 1))) < 4.0 / SAMPLES**0.5


@pytest.mark.parametrize("samples", [-1, 0, 2])
def test_the_likelihood_does_not_jump_where_a_delay_passes_a_sample(samples):
    record = recorded(max(samples, 0) * DT)
    record = early(record, -samples) if samples < 0 else record
    below, above = (
        log_likelihood(packed, [record], [innovations(packed, NOISE, record).innovation])
        for packed in (pack(late(MODEL, (samples + s) * DT, "channel_skew")) for s in (-1e-6, 1e-6))
    )
    # Of 6000 samples one more or less is read.
    assert above == pytest.approx(below, abs=10.0)


@pytest.mark.parametrize("delay", [0.0007, 0.0013, 0.0032])
def test_the_delay_is_found_to_a_hundredth_of_a_sample(delay):
    fit = fit_whole(late(MODEL, 0.0011), NOISE, [recorded(delay)], iterations=20)
    assert fit.model.effects[0].parameters["delay"] == pytest.approx(delay, abs=0.01 * DT)


@pytest.mark.parametrize(
    ("delay", "whole", "lead"),
    [(0.0, 0, 0.0), (0.3, 0, -0.3), (1.6, 1, -0.6), (3.0, 3, 0.0), (-0.2, -1, -0.8), (-1.7, -2, -0.3)],
)
def test_readings_are_looked_for_in_the_sample_before(delay, whole, lead):
    model = late(MODEL, delay * DT, "channel_skew")
    shift, ahead = pack(model).encoder_shift(DT)
    assert list(shift) == [whole, 0]
    assert ahead == pytest.approx([lead * DT, 0.0], abs=1e-12)


def test_long_recordings_are_fitted_on_fewer_samples_first_and_end_at_the_same(record):
    direct = max(
        (fit_whole(late(MODEL, 0.001), n, [record], iterations=30) for n in noise_starts(MODEL, [record])),
        key=lambda fit: fit.log_likelihood,
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("haptic_teleop_sysid.estimation.records.ENOUGH_SAMPLES", SAMPLES // 2)
        assert [len(r) for r in thinned_to([record])] == [SAMPLES // 2]
        quick = fit_from_scratch(late(MODEL, 0.001), [record])
        patch.setattr("haptic_teleop_sysid.estimation.records.ENOUGH_SAMPLES", 10)
        assert thinned_to([record])[0].dt == pytest.approx(2 * DT)
        for nearly in (SAMPLES, SAMPLES - 100):
            patch.setattr("haptic_teleop_sysid.estimation.records.ENOUGH_SAMPLES", nearly)
            whole = [record]
            assert thinned_to(whole) is whole
    assert quick.log_likelihood > direct.log_likelihood - 0.3


def test_the_error_of_a_delay_is_the_same_on_a_whole_sample_as_beside_it():
    errors = []
    for delay in (2.0 * DT, 2.4 * DT):
        fit = fit_whole(late(MODEL, delay), NOISE, [recorded(delay)], iterations=20)
        at = replace(fit, model=fit.model.with_values({fit.free[-1]: delay}))
        errors.append(uncertainty(at, [recorded(delay)]).std[-1])
    assert errors[0] == pytest.approx(errors[1], rel=0.3)
