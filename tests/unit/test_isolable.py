"""How far recordings are expected to tell two models apart, against how far they do."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, joint_record

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.isolable import nats_apart
from haptic_teleop_sysid.diagnosis.evidence.null_records import disturbed_as, null_record
from haptic_teleop_sysid.estimation.likelihood import innovations, log_likelihood
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch


@pytest.fixture(scope="module")
def fitted():
    record = joint_record(21)
    return fit_from_scratch(MODEL, [record]), record


def beside(fit, effect, location, **parameters):
    return replace(fit, model=fit.model.with_effects(Effect(effect, location, parameters)))


def test_the_expected_difference_is_the_mean_of_those_found_on_simulated_recordings(fitted):
    fit, record = fitted
    pulled = beside(fit, "constant_torque", "stage1_motor", torque=0.0004)
    noise = disturbed_as(fit, record)
    expected, found = [], []
    for seed in range(12):
        made = null_record(pulled, noise, record, np.random.default_rng(seed))
        expected.append(nats_apart(pulled, fit, [made]))
        likelihoods = [
            log_likelihood(pack(f.model), [made], [innovations(pack(f.model), fit.noise, made).innovation])
            for f in (pulled, fit)
        ]
        found.append(likelihoods[0] - likelihoods[1])
    nats = float(np.mean(expected))
    assert 5.0 < nats < 500.0
    # A likelihood ratio spreads by sqrt(2 nats) around its mean.
    assert np.mean(found) == pytest.approx(nats, abs=4.0 * np.sqrt(2.0 * nats / len(found)))


def test_a_model_is_nothing_apart_from_itself_and_recordings_add_up(fitted):
    fit, record = fitted
    assert nats_apart(fit, fit, [record]) == 0.0
    other = beside(fit, "constant_torque", "stage1_arm", torque=0.01)
    once = nats_apart(fit, other, [record])
    assert once > 0.0
    assert nats_apart(fit, other, [record, record]) == pytest.approx(2.0 * once)


def test_a_model_that_runs_away_is_infinitely_far(fitted):
    fit, record = fitted
    wild = beside(fit, "spring_to_ground", "stage1_motor", stiffness=1e300, rest=0.0)
    assert nats_apart(fit, wild, [record]) == np.inf
