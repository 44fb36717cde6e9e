"""The small matrix routines of the observer against the library's, which are slower and know more cases."""

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from haptic_teleop_sysid.estimation.riccati import exponential, stationary_filter

DT = 0.002
MEASURED = np.eye(2, 6)


def joint(seed, dt=DT):
    """Return (a, f, q, r) of a random flexible joint with two coloured disturbance torques: continuous and
    discrete system matrix (6, 6), process noise (6, 6), encoder noise (2, 2)."""
    rng = np.random.default_rng(seed)

    def between(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    k, jm, ja = between(0.5, 50.0), between(1e-3, 0.3), between(1e-3, 0.5)
    bm, ba = between(1e-3, 5.0), between(1e-3, 0.5)
    times = np.array([between(0.02, 2.0), between(0.02, 2.0)])
    levels = np.array([between(1e-4, 0.5), between(1e-4, 0.5)])
    a = np.zeros((6, 6))
    a[0, 2] = a[1, 3] = 1.0
    a[2] = np.array([-k, k, -bm, 0.0, 1.0, 0.0]) / jm
    a[3] = np.array([k, -k, 0.0, -ba, 0.0, 1.0]) / ja
    a[4, 4], a[5, 5] = -1.0 / times
    f = expm(a * dt)
    q = np.diag([1e-16, 1e-16, 1e-12, 1e-12, *(levels**2 * (1.0 - np.exp(-2.0 * dt / times)))])
    r = np.diag([between(1e-5, 1e-3) ** 2, between(1e-5, 1e-3) ** 2])
    return a, f, q, r


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("dt", [0.0005, 0.002, 0.02])
def test_the_exponential_is_the_librarys(seed, dt):
    a = joint(seed)[0] * dt
    expected = expm(a)
    assert np.max(np.abs(exponential(a) - expected)) < 1e-10 * np.max(np.abs(expected))


def test_the_exponential_of_a_rotation_is_cosine_and_sine():
    for angle in (0.1, 2.0, 30.0):
        expected = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        assert exponential(np.array([[0.0, -angle], [angle, 0.0]])) == pytest.approx(
            np.array(expected), abs=1e-11
        )


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_the_exponential_of_what_is_not_finite_is_refused(bad):
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        exponential(np.array([[0.0, bad], [0.0, 0.0]]))


@pytest.mark.parametrize("seed", range(25))
def test_the_stationary_filter_is_the_librarys(seed):
    _, f, q, r = joint(seed)
    found, gain = stationary_filter(f, MEASURED, q, r)
    # States span ten orders of magnitude: the library, too, is right only on scaled ones.
    scale = 1.0 / np.sqrt(np.diag(found))
    t, back = np.diag(scale), np.diag(1.0 / scale)
    expected = solve_discrete_are((t @ f @ back).T, (MEASURED @ back).T, t @ q @ t, r)
    assert t @ found @ t == pytest.approx(expected, rel=1e-6, abs=1e-6)
    c = MEASURED @ back
    shown = expected @ c.T
    assert t @ gain == pytest.approx(shown @ np.linalg.inv(c @ shown + r), rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("seed", range(8))
def test_the_stationary_covariance_reproduces_itself_in_one_step_of_the_filter(seed):
    _, f, q, r = joint(seed, 0.001)
    p = stationary_filter(f, MEASURED, q, r)[0]
    corrected = p - p @ MEASURED.T @ np.linalg.solve(MEASURED @ p @ MEASURED.T + r, MEASURED @ p)
    assert np.diag(f @ corrected @ f.T + q) == pytest.approx(np.diag(p), rel=1e-6)


def test_one_state_has_the_solution_of_the_quadratic_equation():
    # p = p r / (p + r) + q, a random walk
    q, r = 0.3, 2.0
    expected = 0.5 * (q + np.sqrt(q * q + 4.0 * q * r))
    found, gain = stationary_filter(np.eye(1), np.eye(1), np.array([[q]]), np.array([[r]]))
    assert found[0, 0] == pytest.approx(expected, rel=1e-9)
    assert gain[0, 0] == pytest.approx(expected / (expected + r), rel=1e-9)


def test_a_growing_state_that_nothing_measures_is_refused():
    f = np.diag([0.9, 1.1])
    # The covariance grows beyond all numbers before it is given up; NumPy says so.
    with np.errstate(all="ignore"), pytest.raises(np.linalg.LinAlgError, match="no solution"):
        stationary_filter(f, np.array([[1.0, 0.0]]), np.eye(2), np.eye(1))


def test_a_random_walk_that_nothing_measures_is_refused():
    with pytest.raises(np.linalg.LinAlgError, match="no solution"):
        stationary_filter(np.diag([0.9, 1.0]), np.array([[1.0, 0.0]]), np.eye(2), np.eye(1))
