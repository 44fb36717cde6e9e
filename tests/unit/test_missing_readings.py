"""Readings that are missing have no score, no angle and no colour."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, NOISE, joint_record

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.residual import left_over
from haptic_teleop_sysid.diagnosis.evidence.whiteness import colour, ljung_box
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales, velocity_of
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import innovation_covariance, log_likelihood, seen
from haptic_teleop_sysid.estimation.whitening import whiten
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

PACKED = pack(MODEL)
SPREAD = np.array([[4e-10, 1.2e-10], [1.2e-10, 1e-10]])


@pytest.fixture(scope="module")
def record():
    return joint_record(21, seconds=20.0)


@pytest.fixture(scope="module")
def errors(record):
    """Innovations as of a true model, of both encoders."""
    return np.random.default_rng(1).multivariate_normal(np.zeros(2), SPREAD, len(record))


def without(record, motor=None, arm=None):
    measured = record.measured.copy()
    for channel, gone in ((0, motor), (1, arm)):
        if gone is not None:
            measured[gone, channel] = np.nan
    return replace(record, measured=measured)


def kept(record, errors):
    """The predictor gives zero where a reading is missing."""
    return np.where(np.isfinite(record.measured), errors, 0.0)


HALF = slice(None, None, 2)


@pytest.mark.parametrize(
    ("gone", "readings"),
    [
        ({"motor": HALF, "arm": HALF}, 0.5),
        ({"motor": slice(0, 5000), "arm": slice(0, 5000)}, 0.5),
    ],
)
def test_with_half_of_the_readings_the_likelihood_of_each_is_the_same(record, errors, gone, readings):
    whole = log_likelihood(PACKED, [record], [errors]) / len(record)
    less = without(record, **gone)
    part = log_likelihood(PACKED, [less], [kept(less, errors)]) / (readings * len(record))
    assert part == pytest.approx(whole, abs=0.03)


@pytest.mark.parametrize("gone", ["motor", "arm"])
def test_one_encoder_that_misses_half_scores_what_it_read(record, errors, gone):
    """Against the likelihood by the true innovation_covariance, added up reading by reading."""
    less = without(record, **{gone: HALF})
    alone = 1 if gone == "motor" else 0
    expected = 0.0
    for i, e in enumerate(errors):
        if i % 2:
            expected -= 0.5 * (np.log(np.linalg.det(SPREAD)) + e @ np.linalg.inv(SPREAD) @ e)
        else:
            expected -= 0.5 * (np.log(SPREAD[alone, alone]) + e[alone] ** 2 / SPREAD[alone, alone])
    constant = 0.5 * (0.5 * 2 + 0.5 * 1) * len(record)  # of the covariance that is concentrated out
    found = log_likelihood(PACKED, [less], [kept(less, errors)])
    assert found == pytest.approx(expected + constant, abs=6.0)
    np.testing.assert_allclose(innovation_covariance(PACKED, less, kept(less, errors)), SPREAD, rtol=0.06)


def test_a_reading_that_is_missing_moves_no_parameter(record, errors):
    less = without(record, motor=slice(0, 4000, 3), arm=slice(1000, 3000))
    slopes = np.random.default_rng(2).standard_normal((len(record), 2, 3))
    there = np.isfinite(less.measured)
    e, jacobian = whiten(PACKED, less, kept(less, errors), np.where(there[:, :, None], slopes, 0.0))
    rows = e.reshape(-1, 2)
    assert np.all(rows[~there] == 0.0)
    assert np.all(jacobian.reshape(-1, 2, 3)[~there] == 0.0)
    for channel in (0, 1):  # and all others have variance one, whatever else was read
        assert np.std(rows[there[:, channel] & ~there[:, 1 - channel], channel]) == pytest.approx(
            1.0, abs=0.06
        )


def test_readings_of_a_late_encoder_are_missing_where_they_were_moved_from(record):

    late = pack(MODEL.with_effects(Effect("sensor_delay", "stage1_arm_encoder", {"delay": 3 * record.dt})))
    assert not seen(late, record)[-3:, 1].any()
    assert seen(late, record)[:-3].all()


def test_a_fit_with_half_of_the_readings_finds_the_same_parameters(record):
    whole, part = (fit_from_scratch(MODEL, [r]) for r in (record, without(record, motor=HALF, arm=HALF)))
    for name, value in whole.model.parameters.items():
        assert part.model.parameters[name] == pytest.approx(value, rel=0.02), name


def test_an_angle_that_is_missing_is_not_zero(record):
    gone = slice(2000, 2004)
    less = without(record, motor=gone, arm=gone)
    velocity = velocity_of(less.measured[:, 0], record.dt)
    true = velocity_of(record.measured[:, 0], record.dt)
    np.testing.assert_allclose(velocity, true, atol=0.1 * np.std(true))
    scales, expected = (recording_scales(MODEL, [r]).size for r in (less, record))
    assert scales["velocity"] == pytest.approx(expected["velocity"], rel=0.01)
    assert scales["deflection"] == pytest.approx(expected["deflection"], rel=0.01)
    fit = Fit(MODEL, NOISE, (), 0.0, np.zeros((0, 0)), np.zeros(0), True, 0, "as given")
    left = left_over(fit, less)
    assert not left.read[gone].any()
    assert left.read.sum() == len(record) - 4
    np.testing.assert_allclose(
        left.quantities["motor angle"], record.measured[:, 0], atol=0.02 * np.ptp(record.measured[:, 0])
    )


def test_the_portmanteau_statistic_is_that_of_ljung_and_box():
    e = np.random.default_rng(3).standard_normal(300)
    c = e - e.mean()
    n, r = len(c), [float(c[k:] @ c[:-k] / (c @ c)) for k in range(1, 26)]
    expected = n * (n + 2) * sum(x**2 / (n - k) for k, x in enumerate(r, start=1))
    assert ljung_box(e, np.ones(n, dtype=bool)) == pytest.approx(expected, rel=1e-9)


def test_it_has_the_mean_of_white_innovations_on_short_recordings_and_with_holes():
    rng = np.random.default_rng(4)
    whole = [ljung_box(rng.standard_normal(120), np.ones(120, dtype=bool)) for _ in range(2000)]
    assert np.mean(whole) == pytest.approx(25.0, abs=0.7)  # Box and Pierce: 21.9
    holes = []
    for _ in range(1000):
        read = rng.uniform(size=400) < 0.5
        holes.append(ljung_box(np.where(read, rng.standard_normal(400), 0.0), read))
    assert np.mean(holes) == pytest.approx(25.0, abs=1.0)


def test_missing_readings_are_no_colour(record):
    fit = fit_from_scratch(MODEL, [record])
    rng = np.random.default_rng(5)
    gone = rng.uniform(size=len(record)) < 0.1
    assert colour(fit, [without(record, motor=gone, arm=gone)]) < colour(fit, [record]) + 60.0
