"""A re-estimate that simulates worse than what it began with is fitted to free runs."""

from dataclasses import replace

import pytest
from stepped_machines import RIGID, pendulum

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.search.freely_fitted import re_estimated, simulating_best
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.tuning import initial_noise
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

BEST = RIGID.parameters["motor_inertia"]


def with_inertia(factor):
    return RIGID.with_values({"motor_inertia": factor * BEST})


@pytest.fixture(scope="module")
def predicted():
    """A fit that predicts best with three times the inertia."""
    records = [pendulum(0)]
    fit = fit_whole(RIGID, initial_noise(pack(RIGID), records), records, iterations=1)
    return replace(fit, model=with_inertia(3.0)), recording_scales(RIGID, records)


def errors(model):
    """Free runs err by what the inertia is off."""
    off = abs(model.parameters["motor_inertia"] / BEST - 1.0)
    return off, 2.0 * off


def nearer(fit):
    """Free runs that want half of what the inertia is off by."""
    own = fit.model.parameters["motor_inertia"] / BEST
    return replace(fit, model=with_inertia(1.0 + 0.5 * (own - 1.0)))


def factor(fit):
    return fit.model.parameters["motor_inertia"] / BEST


def test_it_is_fitted_to_free_runs_from_the_given_model(predicted):
    fit, scales = predicted
    found = re_estimated(SearchResult(fit, fit, (), (), scales), with_inertia(1.4), nearer, errors)
    assert factor(found.baseline) == pytest.approx(1.2)
    assert found.final is found.baseline


def test_what_was_found_stays_as_it_is(predicted):
    fit, scales = predicted
    named = replace(fit, model=fit.model.with_effects(Effect("coulomb_friction", "j_motor", {"torque": 0.1})))
    found = re_estimated(SearchResult(fit, named, (), (), scales), with_inertia(1.4), nearer, errors)
    assert factor(found.baseline) == pytest.approx(1.2)
    assert found.final is named


def test_a_re_estimate_that_simulates_better_than_the_given_model_stays(predicted):
    fit, scales = predicted
    result = SearchResult(fit, fit, (), (), scales)
    assert re_estimated(result, with_inertia(5.0), nearer, errors) is result


@pytest.mark.parametrize(
    ("resized", "runs"),
    [
        (lambda fit: None, errors),  # free runs want nothing
        (nearer, lambda model: (errors(model)[0], 1.0 - 0.1 * errors(model)[1])),  # better here, worse there
        (nearer, lambda model: (float("nan"),) * 2 if factor_of(model) == 1.2 else errors(model)),
    ],
)
def test_what_does_not_help_on_both_kinds_is_not_taken(predicted, resized, runs):
    fit, _ = predicted
    assert simulating_best(fit, [with_inertia(1.4)], resized, runs) is fit


def factor_of(model):
    return pytest.approx(model.parameters["motor_inertia"] / BEST)
