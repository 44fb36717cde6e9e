"""Least squares from products, folds and the filter of the inverse dynamics, against SciPy's."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.signal import butter, sosfiltfilt
from stepped_machines import DT, ELASTIC, RIGID, drive, pendulum, record, two_masses

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.every_hypothesis import hypotheses
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.folds import Fold
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import low_passed
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.products import Products, solved
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.regression import equations
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales


def elastic():
    torque = drive(3, 2.0)
    return record(torque, two_masses(torque, 20.0, (0.06, 0.3), (0.1, 0.02), 0.4), 1e-5)


@pytest.mark.parametrize(("model", "made"), [(RIGID, lambda: pendulum(0, coulomb=0.4)), (ELASTIC, elastic)])
def test_a_group_is_solved_as_by_least_squares_on_all_its_rows(model, made):
    one = made()
    side = Products(equations(model, [one], 8.0))
    every = list(hypotheses(model, recording_scales(model, [one])))
    named = {(h.entry.name, h.place): h for h in every}
    groups = [
        (named["coulomb_friction", "motor"],),
        (named["coulomb_friction", "motor"], named["constant_torque", "motor"]),
    ]
    if model is ELASTIC:
        groups.append((named["coulomb_friction", "arm"], named["joint_damping", "joint"]))
    for group in groups:
        low, high = (
            np.concatenate([side.side.bounds()[i], *(h.bounds()[i] for h in group)]) for i in (0, 1)
        )
        expected = lsq_linear(side.columns(group), side.target.ravel(), bounds=(low, high), tol=1e-14).x
        found = side.fitted(group)
        assert found == pytest.approx(expected, rel=1e-4, abs=1e-6)
        left = side.left(group, found)
        assert side.square_left(group, found) == pytest.approx(float(left @ left), rel=1e-6)


def test_columns_that_are_alike_share_what_they_explain():
    x = np.random.default_rng(1).normal(size=(50, 2))
    columns = np.column_stack([x, x[:, 1]])
    target = x @ [1.0, 3.0]
    bounds = np.array([0.0, -np.inf, -np.inf]), np.full(3, np.inf)
    found = solved(columns.T @ columns, columns.T @ target, *bounds)
    assert found == pytest.approx([1.0, 1.5, 1.5], abs=1e-4)
    # The same where a bound is met.
    target = x @ [-1.0, 3.0]
    free = 3.0 - float(x[:, 0] @ x[:, 1] / (x[:, 1] @ x[:, 1]))
    found = solved(columns.T @ columns, columns.T @ target, *bounds)
    assert found == pytest.approx([0.0, free / 2, free / 2], abs=1e-4)


def test_both_folds_together_are_all_rows():
    parts = tuple(equations(RIGID, [pendulum(s, coulomb=0.4)], 8.0) for s in (0, 1))
    folds = Fold(parts, False), Fold(parts, True)
    assert sum(f.samples for f in folds) == sum(p.samples for p in parts)
    rows = np.concatenate([f.target[:, 0] for f in folds])
    assert sorted(rows) == pytest.approx(sorted(np.concatenate([p.target[:, 0] for p in parts])))
    assert folds[0].base.shape == (1, folds[0].samples, 2)


@pytest.mark.parametrize("times", [1, 2])
def test_the_filter_is_butterworths_forward_and_backward(times):
    values = np.cumsum(np.random.default_rng(2).normal(size=(4000, 2)), axis=0)
    sections = butter(2, 5.0, fs=1.0 / DT, output="sos")
    expected = values
    for _ in range(times):
        expected = sosfiltfilt(sections, expected, axis=0, padlen=300)
    found = low_passed(values, DT, 5.0, times)
    assert found[200:-200] == pytest.approx(expected[200:-200], abs=2e-3 * np.std(values))
