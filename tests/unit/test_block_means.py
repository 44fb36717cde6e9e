"""Blocks carry what lies in the band as all samples do."""

import numpy as np
import pytest

from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.block_means import (
    block_means,
    response,
    sparse_block_means,
    weights,
)
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.motion import low_passed

DT, CUTOFF = 1e-3, 20.0


@pytest.mark.parametrize("block", [1, 2, 3, 5])
def test_a_sine_comes_out_by_the_response(block):
    k = np.arange(4000)
    for cycles in (0.01, 0.2, 0.45):  # per block
        sine = np.exp(2j * np.pi * cycles / block * k)
        parts = np.column_stack([sine.real, sine.imag])
        found = block_means(parts, block, 2) @ [1.0, 1.0j]
        expected = response(np.array([cycles]), block)[0] * sine[2::block]
        assert np.max(np.abs(found - expected)[20:-20]) < 1e-12
    assert np.sum(weights(block)) == pytest.approx(1.0)
    assert response(np.zeros(1), block)[0] == 1.0


@pytest.mark.parametrize("times", [1, 2])
def test_blocks_through_the_low_pass_are_the_samples_through_it_even_of_dry_friction(times):
    t = DT * np.arange(40_000)
    speed = np.sin(7.3 * t) + 0.7 * np.sin(19.0 * t + 0.4) + 0.3 * np.cos(41.0 * t)
    smooth, steps = speed, np.sign(speed)
    block, first = 5, 3
    for values, worst in ((smooth, 1e-6), (steps, 2e-3)):
        whole = low_passed(values, DT, CUTOFF, times)[first::block]
        found = low_passed(block_means(values[:, None], block, first)[:, 0], block * DT, CUTOFF, times, block)
        assert np.max(np.abs(found - whole)[100:-100]) < worst


@pytest.mark.parametrize("number", [100, 101, 1000, 4321])
@pytest.mark.parametrize("start", [0, 1])
def test_every_second_sample_of_the_low_pass_is_every_second_one_of_all(number, start):
    """Of noise, too, whose upper half folds where samples are left out."""
    values = np.random.default_rng(number).normal(size=(number, 3))
    for cutoff in (0.05, 0.2):  # cycles per block
        whole = low_passed(values, 1.0, cutoff, 1, 3)
        found = low_passed(values, 1.0, cutoff, 1, 3, (start, 2))
        assert found.shape == whole[start::2].shape
        assert np.max(np.abs(found - whole[start::2])) < 1e-3 * np.max(np.abs(whole))


def test_means_near_the_ends_go_on_as_the_ends_are():
    values = np.random.default_rng(5).normal(size=(37, 2))
    long = np.concatenate([np.repeat(values[:1], 30, axis=0), values, np.repeat(values[-1:], 30, axis=0)])
    for block, first in ((1, 0), (2, 1), (5, 4)):
        found = block_means(values, block, first)
        np.testing.assert_allclose(found, block_means(long, block, first + 30)[: len(found)], atol=1e-15)


def test_rows_that_are_mostly_zero_give_the_same_means():
    generator = np.random.default_rng(3)
    places = generator.integers(0, 6, (500, 2))
    places[:, 1] = (places[:, 0] + 1) % 6
    values = generator.normal(size=(500, 2))
    dense = np.zeros((500, 6))
    np.put_along_axis(dense, places, values, axis=1)
    found = sparse_block_means(places, values, 6, 3, 1)
    np.testing.assert_allclose(found, block_means(dense, 3, 1), atol=1e-15)
