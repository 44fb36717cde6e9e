"""The sine of arrays against the C library's, which it is not made of."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from haptic_teleop_sim.effects.on_arrays import LARGEST, sine


@given(st.lists(st.floats(-LARGEST, LARGEST), min_size=1, max_size=40))
def test_it_is_the_sine(values: list[float]) -> None:
    expected = [math.sin(v) for v in values]
    np.testing.assert_allclose(sine(np.array(values)), expected, rtol=0.0, atol=3e-16)


def test_it_is_the_sine_where_the_half_turns_change() -> None:
    turns = math.pi * np.arange(-2000, 2000) / 2.0
    for aside in (-1e-9, 0.0, 1e-9):
        found, expected = sine(turns + aside), np.sin(turns + aside)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=3e-16)


def test_small_angles_keep_all_their_digits() -> None:
    small = 10.0 ** np.arange(-300.0, -1.0)
    np.testing.assert_allclose(sine(small), np.sin(small), rtol=3e-16)


def test_any_shape_and_what_is_no_number() -> None:
    surface = np.arange(12.0).reshape(3, 4)
    np.testing.assert_allclose(sine(surface.T), np.sin(surface.T), rtol=0.0, atol=3e-16)
    np.testing.assert_allclose(sine(surface[:, ::2]), np.sin(surface[:, ::2]), rtol=0.0, atol=3e-16)
    assert sine(np.float64(0.5)) == np.sin(0.5)
    assert sine(np.array([])).size == 0
    far = np.array([1.0, 1e9])
    np.testing.assert_array_equal(sine(far), np.sin(far))
    assert np.isnan(sine(np.array([0.0, np.nan]))).tolist() == [False, True]
