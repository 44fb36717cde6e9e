"""The loop of damped Gauss-Newton steps, on functions whose top is known."""

from dataclasses import dataclass

import numpy as np
import pytest

from haptic_teleop_sysid.estimation.gauss_newton import Damping, Problem, maximise

DAMPED = Damping(first=1e-9, raised=1e-3, least=1e-9, tries=10)


@dataclass(frozen=True)
class Place:
    theta: np.ndarray
    value: float


def climbing(residual, slope, size, far=np.inf):
    """Least squares of ``residual`` with derivatives ``slope``, and where equations were asked for."""
    asked = []

    def at(theta, before, damping):
        return Place(theta, -0.5 * float(np.sum(residual(theta) ** 2)))

    def equations(point, theta):
        asked.append(theta)
        jacobian = slope(theta)
        return jacobian.T @ jacobian, jacobian.T @ residual(theta)

    def limited(point, theta, new):
        return np.clip(new, theta - far, theta + far)

    wide = np.full(size, 1e9)
    return Problem(at, equations, limited, -wide, wide), asked


def test_a_step_that_holds_what_it_promised_is_the_last_one():
    random = np.random.default_rng(1)
    a, b = random.normal(size=(50, 3)), random.normal(size=50)
    problem, asked = climbing(lambda t: a @ t - b, lambda t: a, 3)
    start = np.full(3, 5.0)
    end = maximise(problem, start, problem.at(start, None, 0.0), DAMPED, iterations=20, enough=0.01)
    assert end.converged and len(asked) == 1
    assert end.theta == pytest.approx(np.linalg.lstsq(a, b, rcond=None)[0], abs=1e-6)


def test_a_step_that_was_shortened_is_not_the_last_one_although_it_holds_what_it_promised():
    problem, asked = climbing(lambda t: 3.0 * (t - 4.0), lambda t: np.array([[3.0]]), 1, far=1.0)
    start = np.zeros(1)
    end = maximise(problem, start, problem.at(start, None, 0.0), DAMPED, iterations=20, enough=0.01)
    assert end.converged and end.theta == pytest.approx([4.0]) and len(asked) == 4


@pytest.mark.parametrize("begin", [-3.0, -1.0, 0.5, 2.0])
def test_where_the_function_bends_it_ends_within_what_is_enough_of_the_top(begin):
    """Residuals exp(t) - 2 and t / 3: the top by a fine grid."""
    problem, _ = climbing(
        lambda t: np.array([10.0 * (np.exp(t[0]) - 2.0), t[0] / 3.0]),
        lambda t: np.array([[10.0 * np.exp(t[0])], [1.0 / 3.0]]),
        1,
        far=0.7,
    )
    start = np.array([begin])
    end = maximise(problem, start, problem.at(start, None, 0.0), DAMPED, iterations=50, enough=0.01)
    best = max(problem.at(np.array([t]), None, 0.0).value for t in np.linspace(0.6, 0.8, 2001))
    assert end.converged and best - end.point.value < 0.01


def test_two_directions_that_break_their_promises_in_opposite_ways_do_not_pass_for_one_that_holds_it():
    """One bends more than it seems, and its step gains less; one bends ten times less, and gains more."""
    true, seems = np.array([1.2, 1.0]), np.diag([1.0, 10.0])

    def at(theta, before, damping):
        return Place(theta, -0.5 * float(true @ theta**2))

    wide = np.full(2, 1e9)
    problem = Problem(at, lambda point, theta: (seems, true * theta), lambda p, t, new: new, -wide, wide)
    start = np.array([0.87, 1.5])
    end = maximise(problem, start, at(start, None, 0.0), DAMPED, iterations=99, enough=0.03)
    assert end.converged and end.count > 3 and -end.point.value < 0.35
