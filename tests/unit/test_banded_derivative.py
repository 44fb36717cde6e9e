"""Derivatives of recorded angles, against motions whose derivatives are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from haptic_teleop_sysid.recordings.banded_derivative import banded_derivative, moving_band, to_the_next

DT = 0.002
STEP = 2 * np.pi / 4096


def motion(frequencies, amplitudes, seconds=20.0, order=0):
    t = np.arange(round(seconds / DT)) * DT
    phases = [w * t + k + order * np.pi / 2 for k, w in enumerate(2 * np.pi * np.array(frequencies))]
    rates = (2 * np.pi * np.array(frequencies)) ** order
    return sum(a * r * np.sin(p) for a, r, p in zip(amplitudes, rates, phases, strict=True))


def rounded(angle):
    return STEP * np.round(angle / STEP)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_rounded_motion_of_several_hertz_keeps_its_size(order):
    parts = (0.7, 2.3, 5.1), (0.3, 0.1, 0.06)
    true, found = motion(*parts, order=order), banded_derivative(rounded(motion(*parts)), order, DT)
    inside = slice(500, -500)
    size = found[inside] @ true[inside] / (true[inside] @ true[inside])
    assert size == pytest.approx(1.0, abs=0.005)
    assert np.std(found[inside] - true[inside]) < 0.04 * np.std(true)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.5, 12.0))
def test_an_acceleration_is_neither_weakened_nor_delayed_at_any_frequency(frequency):
    amplitude = 100.0 * STEP * max(1.0, 5.0 / frequency)
    true = motion((frequency,), (amplitude,), order=2)
    found = banded_derivative(rounded(motion((frequency,), (amplitude,))), 2, DT)
    inside = slice(1000, -1000)
    ahead = np.gradient(true, DT)[inside]
    columns = np.stack([true[inside], ahead], axis=1)
    size, delay = np.linalg.lstsq(columns, found[inside], rcond=None)[0]
    assert size == pytest.approx(1.0, abs=0.02)
    assert abs(delay) < 0.1 * DT


def test_what_acts_over_a_sample_is_the_change_of_the_velocity_in_it():
    parts = (0.7, 2.3, 5.1), (0.3, 0.1, 0.06)
    speed = motion(*parts, order=1)
    true = np.append(np.diff(speed), 0.0) / DT
    inside = slice(500, -500)
    late = np.gradient(true, DT)[inside]
    for found, delay in (
        (to_the_next(banded_derivative(rounded(motion(*parts)), 2, DT)), 0.0),
        (banded_derivative(rounded(motion(*parts)), 2, DT), -0.5 * DT),
    ):
        columns = np.stack([true[inside], late], axis=1)
        size, shift = np.linalg.lstsq(columns, found[inside], rcond=None)[0]
        assert size == pytest.approx(1.0, abs=0.005) and shift == pytest.approx(delay, abs=0.02 * DT)


def test_the_band_ends_where_the_motion_does():
    assert 5.1 < moving_band(rounded(motion((0.7, 2.3, 5.1), (0.3, 0.1, 0.06))), DT) < 10.0


@pytest.mark.parametrize("samples", [600, 1000, 2000])
@pytest.mark.parametrize("seed", range(4))
def test_a_short_recording_of_a_slow_motion_has_a_narrow_band(samples, seed):
    """Of one stretch alone some line of the noise stands out, and the acceleration is noise up to there."""
    t = 0.01 * np.arange(samples)
    noise = 1e-3 * np.random.default_rng(seed).normal(size=samples)
    assert moving_band(rounded(0.5 * np.sin(2 * np.pi * 0.6 * t + seed) + noise), 0.01) < 6.0


def test_few_samples_and_a_joint_that_stands_give_numbers():
    for values in (np.zeros(400), np.zeros(3), np.arange(5.0), np.ones(1)):
        for order in (0, 1, 2):
            assert np.all(np.isfinite(banded_derivative(values, order, DT)))
    assert banded_derivative(np.arange(6.0) * DT, 1, DT) == pytest.approx(np.ones(6))
