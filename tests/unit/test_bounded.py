"""Least squares within bounds from products of columns, against SciPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.bounded import within_bounds
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.products import solved


@given(seed=st.integers(0, 10_000), size=st.integers(1, 9), alike=st.booleans())
def test_no_solution_within_the_bounds_leaves_less(seed, size, alike):
    draw = np.random.default_rng(seed)
    columns = draw.normal(size=(30, size)) * 10.0 ** draw.uniform(-3.0, 3.0, size)
    if alike and size > 1:
        columns[:, 1] = columns[:, 0] * (1.0 + 1e-3 * draw.normal(size=30))
    length = np.linalg.norm(columns, axis=0)
    target = columns @ (draw.normal(size=size) / length) + 0.3 * draw.normal(size=30)
    low = np.where(draw.random(size) < 0.6, 0.0, -np.inf)
    high = np.where(draw.random(size) < 0.3, 0.5 / length, np.inf)
    found, ended = within_bounds(columns.T @ columns, columns.T @ target, low, high)
    assert ended
    assert np.all(found >= low)
    assert np.all(found <= high)
    exact = lsq_linear(columns / length, target, (low * length, high * length), "bvls", tol=1e-14)
    left = np.sum((target - columns @ found) ** 2)
    assert left <= 2.0 * exact.cost * (1.0 + 1e-6) + 1e-12


def test_numbers_beyond_linear_algebra_are_refused():
    with pytest.raises((np.linalg.LinAlgError, ValueError)):
        solved(np.full((2, 2), np.nan), np.ones(2), np.zeros(2), np.full(2, np.inf))
