"""Starts of trials: what is carried from one model to another stays a model."""

from dataclasses import replace

import pytest
from test_diagnosis_parts import MODEL

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.trials import _in_currents


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
