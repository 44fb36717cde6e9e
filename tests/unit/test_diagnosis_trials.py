"""Starts of trials: what is carried from one model to another stays a model."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, joint_record

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.starts.screen import _by_differences
from haptic_teleop_sysid.diagnosis.starts.trials import _in_currents
from haptic_teleop_sysid.estimation import prediction_fit
from haptic_teleop_sysid.estimation.likelihood import innovations
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch


def with_constant(factor):
    constant = factor * MODEL.parameters["torque_constant"]
    return replace(MODEL, parameters={**MODEL.parameters, "torque_constant": constant})


def test_a_limit_goes_with_the_torque_constant():
    limit = Effect("torque_saturation", "stage1_actuator", {"limit": 2.0})
    assert _in_currents(limit, MODEL, with_constant(0.9)).parameters["limit"] == pytest.approx(1.8)
    delay = Effect("input_delay", "stage1_actuator", {"delay": 0.004})
    assert _in_currents(delay, MODEL, with_constant(0.9)).parameters["delay"] == 0.004


def test_a_limit_at_its_bound_stays_within_it():
    entry = Effect("torque_saturation", "stage1_actuator", {"limit": 1.0}).entry
    least = Effect("torque_saturation", "stage1_actuator", {"limit": entry.parameter("limit").minimum})
    moved = _in_currents(least, MODEL, with_constant(0.88))
    assert MODEL.with_effects(moved).effects[0].parameters["limit"] == entry.parameter("limit").minimum


@pytest.mark.parametrize(
    ("effect", "place", "parameters"),
    [
        ("torque_ripple", "motor", {"amplitude": 2e-3, "order": 7.0, "phase": 0.4}),
        ("quadratic_drag", "arm", {"coefficient": 1e-3}),
        ("gravity", "arm", {"torque": 1e-3, "phase": 0.0}),
        ("input_delay", "actuator", {"delay": 1e-4}),
        ("encoder_scale", "arm_encoder", {"scale": 1.001}),
    ],
)
def test_differences_of_a_small_candidate_are_its_derivatives(effect, place, parameters):
    record = joint_record(4)
    fit = fit_from_scratch(MODEL, [record])
    model = MODEL.with_effects(Effect(effect, f"stage1_{place}", parameters))
    own = [f"stage1_{place}.{effect}.{name}" for name in parameters if name != "order"]
    without = innovations(pack(MODEL), fit.noise, record).innovation
    exact = innovations(pack(model), fit.noise, record, tuple(own))
    found = _by_differences(model, own, fit, record, without)
    np.testing.assert_array_equal(found.innovation, exact.innovation)
    for i in range(len(own)):
        size = np.linalg.norm(exact.d_innovation[:, :, i])
        assert np.linalg.norm(found.d_innovation[:, :, i] - exact.d_innovation[:, :, i]) < 0.02 * size


def test_a_fit_ends_where_steps_promise_what_they_do_not_hold(monkeypatch):
    """As at a kink: each step promises 50 nats, and gains a hundredth of one."""
    count = len(MODEL.free_parameters())
    asked = []

    def equations(model, noise, records, names):
        asked.append(model)
        return np.eye(count), np.full(count, (100.0 / count) ** 0.5), 0.01 * len(asked)

    monkeypatch.setattr(prediction_fit, "normal_equations", equations)
    record = joint_record(4)
    for tolerance, steps in ((1.0, 1), (0.01, 5)):
        asked.clear()
        found = prediction_fit.fit_parameters(
            MODEL, NoiseModel(0.1, 0.1, 1e-4, 1e-4), [record], iterations=5, tolerance=tolerance
        )
        assert (found.iterations, found.converged) == (steps, steps == 1)
