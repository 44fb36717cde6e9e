"""A factor that changes with time: its evidence beside the normal density, and what it tells apart."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import multivariate_normal

from haptic_teleop_sysid.diagnosis.evidence.changing_factor import (
    MEMORIES,
    SIZES,
    Surprise,
    best,
    log_evidence,
)

DT, SKIPPED = 0.01, 20


def surprise(torque, seed=0, read=None):
    """White innovations of two encoders plus the observer's answer to a torque (n,)."""
    random = np.random.default_rng(seed)
    answer = np.column_stack([np.exp(-np.arange(30) / 5.0), np.exp(-np.arange(30) / 8.0)])
    errors = random.standard_normal((len(torque), 2))
    errors += np.column_stack([lfilter(one, 1.0, torque) for one in answer.T])
    read = np.ones(errors.shape, dtype=bool) if read is None else read
    errors = (errors * read)[SKIPPED:].reshape(-1)
    allowed = np.linalg.qr(random.standard_normal((len(errors), 2)))[0]
    return Surprise(errors, allowed, read, answer, DT)


def test_it_is_the_ratio_of_two_normal_densities():
    random = np.random.default_rng(1)
    read = random.random((120, 2)) > 0.2
    values = random.standard_normal(120)
    one = surprise(0.3 * values * (np.arange(120) > 60), read=read)
    found = log_evidence(one, values)
    cell, cells = 5, 24
    columns = np.zeros((len(one.errors), cells))
    for number in range(cells):
        part = np.zeros(120)
        part[cell * number : cell * (number + 1)] = values[cell * number : cell * (number + 1)]
        both = np.column_stack([lfilter(a, 1.0, part) for a in one.answer.T]) * read
        columns[:, number] = both[SKIPPED:].reshape(-1)
    # What is allowed for beside is of any size: the density of what is at a right angle to it.
    away = np.linalg.svd(one.allowed)[0][:, one.allowed.shape[1] :].T
    errors, columns = away @ one.errors, away @ columns
    time = cell * DT * np.arange(cells)
    for memory, size in ((1, 12), (3, 15), (0, 14)):
        likeness = np.eye(cells)
        if MEMORIES[memory]:
            likeness = np.exp(-np.abs(time[:, None] - time) / MEMORIES[memory])
        spread = np.eye(len(errors)) + SIZES[size] ** 2 * columns @ likeness @ columns.T
        expected = multivariate_normal(cov=spread).logpdf(errors) - multivariate_normal(
            cov=np.eye(len(errors))
        ).logpdf(errors)
        assert found[memory, size] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_what_is_lost_for_moments_is_told_from_another_quantity(seed):
    random = np.random.default_rng(seed)
    one, other = (lfilter([0.2], [1.0, -0.8], random.standard_normal(1500)) for _ in range(2))
    at = np.repeat(random.random(75) < 0.1, 20)
    asked = surprise(2.0 * one * at, seed)
    assert best([log_evidence(asked, one)]) > 30.0 + best([log_evidence(asked, other)])


@pytest.mark.parametrize("seed", range(4))
def test_of_white_innovations_nothing_makes_more(seed):
    values = np.random.default_rng(seed).standard_normal(1500)
    assert best([log_evidence(surprise(np.zeros(1500), seed), values)]) < 4.0
