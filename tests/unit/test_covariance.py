"""Covariances of estimates, against least squares repeated on fresh data."""

import numpy as np
import pytest

from haptic_teleop_sysid.simulation.covariance import deviations, sandwich, scaled_inverse, score_covariance


def remembering(luck, n):
    """Random values (n,) that remember 0.8 of the one before, and of variance 1 in the long run of n."""
    found = np.empty(n)
    found[0] = luck.standard_normal()
    for k in range(1, n):
        found[k] = 0.8 * found[k - 1] + 0.6 * luck.standard_normal()
    return found


def test_errors_that_remember_are_counted():
    # The regressor remembers, too: then errors that are taken for white make a line's slope look too sure.
    luck, n, found, told = np.random.default_rng(0), 2000, [], []
    for _ in range(300):
        column = np.column_stack([remembering(luck, n), np.ones(n)])
        target = column @ [2.0, 1.0] + remembering(luck, n)
        information = column.T @ column
        values = np.linalg.solve(information, column.T @ target)
        scores = column * (target - column @ values)[:, None]
        found.append(values)
        told.append(deviations(sandwich(information, score_covariance(scores, 40))))
    scatter = np.std(found, axis=0)
    assert np.mean(told, axis=0) == pytest.approx(scatter, rel=0.12)
    assert scatter[0] > 1.8 / np.sqrt(n)


def test_a_direction_of_which_nothing_is_known_is_told_whatever_the_units():
    known = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 4.0]])
    units = np.array([1e3, 1e-4, 1.0])
    scale, inverse, lost = scaled_inverse(known * np.outer(units, units))
    assert scale == pytest.approx(np.sqrt(np.diag(known)) * units)
    assert lost.shape == (3, 1)
    assert np.abs(lost[:, 0]) == pytest.approx([np.sqrt(0.5), np.sqrt(0.5), 0.0], abs=1e-9)
    # Along it the inverse is zero; of the rest it is the inverse.
    assert inverse @ lost[:, 0] == pytest.approx(np.zeros(3), abs=1e-9)
    assert inverse[2, 2] == pytest.approx(1.0)


def test_nothing_to_invert_is_no_error():
    scale, inverse, _ = scaled_inverse(np.zeros((0, 0)))
    assert scale.shape == (0,)
    assert inverse.shape == (0, 0)
