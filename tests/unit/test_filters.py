"""The filters against scipy's first-order-hold discretisation, a dense integration, and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal
from scipy.linalg import expm

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.filters import VelocityFilter, low_pass_coefficients, velocity_coefficients


def run(filter_, samples):
    return np.array([filter_.step(np.atleast_1d(sample)) for sample in samples])


def wandering(n, channels, seed=3):
    return np.cumsum(np.random.default_rng(seed).normal(scale=1e-2, size=(n, channels)), axis=0)


@pytest.mark.parametrize(
    ("dt", "cutoff", "damping"), [(0.002, 40.0, 0.9), (0.001, 40.0, 1.0), (0.01, 90.0, 2.0)]
)
def test_velocity_filter_is_the_continuous_filter_for_straight_lines_between_samples(dt, cutoff, damping):
    wc = 2 * math.pi * cutoff
    samples = wandering(300, 2)
    system = signal.TransferFunction([wc**2, 0.0], [1.0, 2 * damping * wc, wc**2])
    filter_ = VelocityFilter(2, dt, cutoff, damping)
    filter_.reset(samples[0])
    ours = run(filter_, samples)
    for channel in range(2):
        _, expected, _ = signal.lsim(system, samples[:, channel] - samples[0, channel], np.arange(300) * dt)
        np.testing.assert_allclose(ours[:, channel], expected, atol=1e-10 * wc)


def test_velocity_filter_agrees_with_scipys_first_order_hold():
    dt, wc, damping = 0.002, 2 * math.pi * 40.0, 0.9
    samples = wandering(400, 1)[:, 0]
    numerator, denominator, _ = signal.cont2discrete(
        ([wc**2, 0.0], [1.0, 2 * damping * wc, wc**2]), dt, method="foh"
    )
    expected = signal.lfilter(numerator[0], denominator, samples - samples[0])
    ours = run(VelocityFilter(1, dt), samples)[:, 0]
    np.testing.assert_allclose(ours, expected, atol=1e-9)


@pytest.mark.parametrize("dt", [1e-5, 0.001, 0.002, 0.1])
@pytest.mark.parametrize(("cutoff", "damping"), [(40.0, 0.9), (200.0, 1.0), (1.0, 5.0)])
def test_the_coefficients_are_the_matrix_exponential_of_the_held_line(dt, cutoff, damping):
    wc = 2 * math.pi * cutoff
    block = np.zeros((4, 4))
    block[:2] = [[0.0, 1.0, 0.0, 0.0], [-(wc**2), -2 * damping * wc, wc**2, 0.0]]
    block[2, 3] = 1 / dt
    exact = expm(block * dt)[:2]
    ours = velocity_coefficients(dt, cutoff, damping)
    expected = np.column_stack([exact[:, :2], exact[:, 2] - exact[:, 3], exact[:, 3]])
    np.testing.assert_allclose(ours, expected, rtol=1e-11, atol=1e-13 * wc)


@pytest.mark.parametrize("dt", [0.0005, 0.002, 0.05])
def test_a_ramp_gives_its_slope_whatever_the_sampling_time(dt):
    filter_ = VelocityFilter(2, dt)
    slopes = np.array([1.2, -0.3])
    times = np.arange(0.0, 0.5, dt)[:, None]
    settled = run(filter_, 0.7 + slopes * times)[times[:, 0] > 0.2]
    np.testing.assert_allclose(settled, np.broadcast_to(slopes, settled.shape), rtol=1e-9)


def test_a_reset_with_velocity_continues_a_ramp_without_a_transient():
    filter_ = VelocityFilter(1, 0.002)
    filter_.reset(5.0, 2.0)
    samples = 5.0 + 2.0 * 0.002 * np.arange(1, 50)
    np.testing.assert_allclose(run(filter_, samples), 2.0, rtol=1e-10)


def test_the_first_sample_is_the_rest_position():
    assert run(VelocityFilter(1, 0.002), [3.0, 3.0, 3.0]).tolist() == [[0.0], [0.0], [0.0]]


def test_a_changing_sampling_time_keeps_the_filter_exact():
    random = np.random.default_rng(8)
    intervals = random.uniform(0.0005, 0.004, size=200)
    times = np.concatenate([[0.0], np.cumsum(intervals)])
    samples = wandering(201, 1)[:, 0]
    filter_ = VelocityFilter(1, 0.002)
    filter_.reset(samples[0])
    ours = [filter_.step([sample], dt)[0] for sample, dt in zip(samples[1:], intervals, strict=True)]

    # The same straight lines on a dense uniform grid: corners are met only to within a grid step.
    wc = 2 * math.pi * 40.0
    dense = np.linspace(0.0, times[-1], 400_001)
    system = signal.TransferFunction([wc**2, 0.0], [1.0, 2 * 0.9 * wc, wc**2])
    _, response, _ = signal.lsim(system, np.interp(dense, times, samples - samples[0]), dense)
    expected = np.interp(times[1:], dense, response)
    np.testing.assert_allclose(ours, expected, atol=1e-3 * np.max(np.abs(expected)))


def test_many_turns_away_from_zero_cost_no_precision():
    samples = wandering(200, 1)
    near = run(VelocityFilter(1, 0.002), samples)
    far = run(VelocityFilter(1, 0.002), samples + 2.0**20)
    np.testing.assert_allclose(far, near, atol=1e-6)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e308])
def test_a_position_that_is_not_usable_spoils_only_its_own_sample_and_channel(bad):
    filter_ = VelocityFilter(2, 0.002)
    clean = VelocityFilter(1, 0.002)
    for k, sample in enumerate(wandering(50, 2)):
        spoiled = k == 20
        velocity = filter_.step([bad if spoiled else sample[0], sample[1]])
        assert math.isnan(velocity[0]) == spoiled
        assert velocity[1] == clean.step([sample[1]])[0]
    filter_.reset([1.0, 1.0])
    assert np.all(filter_.step([1.0, 1.0]) == 0.0)


def low_passed(samples, dt, cutoff):
    """The samples behind the low-pass, by its coefficients, as if the input had always been the first."""
    output, now, following = low_pass_coefficients(dt, cutoff)
    rest = [samples[0] * (1.0 - following)]
    return signal.lfilter([following, now], [1.0, -output], samples, zi=rest)[0]


def test_low_pass_is_the_continuous_filter_for_straight_lines_between_samples():
    dt, cutoff = 0.002, 5.0
    samples = wandering(300, 1)[:, 0]
    wc = 2 * math.pi * cutoff
    _, expected, _ = signal.lsim(([wc], [1.0, wc]), samples - samples[0], np.arange(300) * dt)
    np.testing.assert_allclose(low_passed(samples, dt, cutoff), expected + samples[0], atol=1e-12)


def test_low_pass_step_response_reaches_63_percent_after_one_time_constant():
    cutoff, dt = 10.0, 1e-5
    tau = 1.0 / (2 * math.pi * cutoff)
    response = low_passed(np.concatenate([[0.0], np.ones(round(tau / dt))]), dt, cutoff)
    assert response[-1] == pytest.approx(1 - math.exp(-1), abs=1e-3)


def test_low_pass_with_infinite_cutoff_passes_the_signal_through():
    samples = wandering(20, 1)[:, 0]
    assert np.array_equal(low_passed(samples, 0.002, math.inf), samples)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: VelocityFilter(0, 0.002), "channels"),
        (lambda: VelocityFilter(1, 0.0), "dt"),
        (lambda: VelocityFilter(1, math.nan), "dt"),
        (lambda: VelocityFilter(1, 0.002, cutoff_hz=-1.0), "cutoff_hz"),
        (lambda: VelocityFilter(1, 0.002, damping=0.0), "damping"),
        (lambda: VelocityFilter(1, 0.002, cutoff_hz=math.nan), "cutoff_hz"),
    ],
)
def test_impossible_settings_are_refused_by_name(make, word):
    with pytest.raises(ConfigurationError, match=word):
        make()


def test_a_wrong_number_of_channels_is_an_error():
    with pytest.raises(ValueError):
        VelocityFilter(2, 0.002).step([1.0, 2.0, 3.0])
