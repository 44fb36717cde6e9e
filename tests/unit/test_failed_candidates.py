"""What linear algebra fails at is the end of one candidate, not of the program."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, NOISE, fit_of, joint_record

from haptic_teleop_sim.effects import effect_entry
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence.modulation import modulations
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales, within_reach
from haptic_teleop_sysid.diagnosis.starts import screen as screening
from haptic_teleop_sysid.diagnosis.starts.answers import Answers
from haptic_teleop_sysid.diagnosis.starts.scan import scan
from haptic_teleop_sysid.diagnosis.starts.screen import screen
from haptic_teleop_sysid.diagnosis.starts.shortlist import shortlist
from haptic_teleop_sysid.diagnosis.starts.trials import best_of_each
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters, normal_equations
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole

FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.05})
DRAG = Effect("quadratic_drag", "stage1_motor", {"coefficient": 0.05})
#: No observer belongs to such levels.
IMPOSSIBLE = replace(NOISE, motor_angle=1e-200)


@pytest.fixture(scope="module")
def records():
    return [joint_record(31, seconds=3.0)]


@pytest.mark.parametrize("fit", [fit_parameters, fit_whole])
def test_a_fit_that_arithmetic_fails_at_predicts_nothing(records, fit):
    found = fit(MODEL, IMPOSSIBLE, records)
    assert found.log_likelihood == -np.inf
    assert not found.converged
    assert found.free == MODEL.free_parameters()
    assert normal_equations(MODEL, IMPOSSIBLE, records, found.free)[2] == -np.inf


@pytest.mark.parametrize(
    "failure", [np.linalg.LinAlgError("not positive definite"), OverflowError("too large")]
)
def test_the_other_candidates_are_screened(records, monkeypatch, failure):
    fit = fit_from_scratch(MODEL, records)
    scored = screening._score

    def fails(fit, records, effect, structure):
        if effect is FRICTION:
            raise failure
        return scored(fit, records, effect, structure)

    alone = screen(fit, records, [DRAG])
    monkeypatch.setattr(screening, "_score", fails)
    assert screen(fit, records, [FRICTION, DRAG]) == alone


def test_a_model_without_observer_scans_screens_and_asks_nothing(records):
    fit = replace(fit_of(MODEL.with_effects(FRICTION)), noise=IMPOSSIBLE, free=("torque_constant",))
    fit = replace(fit, free=("stage1_motor.coulomb_friction.torque",))
    scales = recording_scales(MODEL, records)
    assert screen(fit, records, [DRAG]) == []
    assert scan(fit, records, scales) == {}
    assert modulations(fit, FRICTION, records) == {}
    assert best_of_each([replace(fit, log_likelihood=-np.inf)], 0) == []


def test_a_quiet_noise_model_that_fails_leaves_the_fitted_one(records, monkeypatch):
    fit = fit_from_scratch(MODEL, records)
    scales = recording_scales(MODEL, records)
    from haptic_teleop_sysid.diagnosis.starts import shortlist as listing

    monkeypatch.setattr(listing, "quiet", lambda noise: IMPOSSIBLE)
    own, other = shortlist(fit, records, scales, within_reach(MODEL, scales), True, {})
    assert [s.effect for s in own] == [s.effect for s in other]


def test_a_scan_goes_on_beside_a_value_that_arithmetic_fails_at(records, monkeypatch):
    fit = fit_from_scratch(MODEL, records)
    entry = effect_entry("torque_ripple")
    orders = [1.0 + 0.5 * k for k in range(20)]
    asked = entry, entry.parameter("order"), "motor", orders
    whole = Answers(fit, records).gains(*asked)
    promised = Answers._promised
    failed = 7

    def fails(self, parts, number):
        found = promised(self, parts, number)
        if np.any(np.isclose(found, whole[failed])):
            raise np.linalg.LinAlgError("SVD did not converge")
        return found

    monkeypatch.setattr(Answers, "_promised", fails)
    found = Answers(fit, records).gains(*asked)
    assert found[failed] == 0.0
    assert np.allclose(np.delete(found, failed), np.delete(whole, failed))
