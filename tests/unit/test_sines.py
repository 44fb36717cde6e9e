"""The sine of long series against the library's."""

import numpy as np
import pytest

from haptic_teleop_sim.effects.sines import sin

ONE_ROUNDING = 2.3e-16


@pytest.mark.parametrize("furthest", [1e-3, 2.0, 60.0, 9e4])
def test_many_sines_are_those_of_the_library(furthest):
    angles = np.random.default_rng(3).uniform(-furthest, furthest, 5000)
    assert np.max(np.abs(sin(angles) - np.sin(angles))) <= ONE_ROUNDING


def test_near_whole_half_turns_the_sine_keeps_its_digits():
    angles = np.arange(-400, 400) * np.pi
    np.testing.assert_allclose(sin(angles), np.sin(angles), rtol=1e-9, atol=0.0)


def test_columns_keep_their_shape_and_what_is_no_number_or_far_away_is_left_to_the_library():
    angles = np.random.default_rng(4).uniform(-3.0, 3.0, (400, 3))[:, ::2]
    angles[7, 1], angles[8, 0] = np.nan, 1e9
    assert sin(angles).shape == (400, 2)
    np.testing.assert_allclose(sin(angles), np.sin(angles), rtol=0.0, atol=ONE_ROUNDING)
    assert sin(0.5) == np.sin(0.5)
