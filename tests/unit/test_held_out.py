"""Two kinds of recordings that share parameters: what each knows, and what both gain where they agree."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import fit_of
from hypothesis import given
from hypothesis import strategies as st
from identification_plants import STAGE, stage_recording

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.diagnosis.evidence.certainty import known_beside
from haptic_teleop_sysid.diagnosis.evidence.held_out import all_reconciled, reconciled
from haptic_teleop_sysid.estimation.likelihood import likelihood_of
from haptic_teleop_sysid.estimation.records import record_from
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch, fit_whole
from haptic_teleop_sysid.recordings.dataset import load_dataset


def recorded(seed, seconds):
    recording = stage_recording(STAGE, seed=seed, seconds=seconds, rms=0.15, band=(0.2, 6.0))
    return record_from(load_dataset(recording, STAGE), commanded=True)


@pytest.fixture(scope="module")
def fits():
    """A short recording, a longer one, and both, each fitted."""
    short, long = recorded(3, 12.0), recorded(4, 24.0)
    here = fit_from_scratch(STAGE, [short])
    there = fit_whole(here.model, here.noise, [long], free=(), iterations=20)
    both = max(
        (fit_whole(here.model, n, [short, long], iterations=30) for n in (here.noise, there.noise)),
        key=lambda f: f.log_likelihood,
    )
    return short, long, here, there, both


def test_what_both_gain_is_what_a_fit_to_both_gains(fits):
    short, long, here, there, both = fits
    free_there = fit_whole(both.model, there.noise, [long], free=(), iterations=20)
    free_here = fit_whole(both.model, here.noise, [short], free=(), iterations=20)
    together = free_here.log_likelihood + free_there.log_likelihood
    apart = here.log_likelihood + there.log_likelihood
    assert together > apart + 2.0
    gained = reconciled(here, there, [long]).log_likelihood - there.log_likelihood
    assert gained == pytest.approx(together - apart, abs=0.5 + 0.2 * (together - apart))


def test_noise_levels_in_a_hollow_are_not_held_against_a_fit(fits):
    """Of gravity and a spring that pull alike one gained 11 nats less: the search for its noise levels had
    stopped elsewhere."""
    _, long, here, there, _ = fits
    slow = replace(there.noise, arm_time=1000.0 * there.noise.arm_time)
    hollow = replace(there, noise=slow, log_likelihood=likelihood_of(pack(there.model), slow, [long]))
    low, high = (reconciled(here, one, [long]).log_likelihood for one in (hollow, there))
    assert low < high - 1.0
    (well, _), (ill, noise) = all_reconciled([(here, there), (here, hollow)], [long])
    assert noise != hollow.noise
    assert ill + hollow.log_likelihood == pytest.approx(well + there.log_likelihood, abs=0.5)


def test_a_fit_that_predicts_nothing_there_gains_nothing(fits):
    _, long, here, there, _ = fits
    nothing = replace(there, log_likelihood=-np.inf)
    for pairs in ([(here, there), (here, nothing)], [(here, nothing), (here, there)]):
        gains = [gain for gain, _ in all_reconciled(pairs, [long])]
        assert np.all(np.isfinite(gains))
        assert gains[[there for _, there in pairs].index(nothing)] == 0.0


def test_another_machine_is_not_granted_what_it_wants(fits):
    short, _, here, there, _ = fits
    other = replace(
        STAGE, parameters={**STAGE.parameters, "arm_inertia": 1.3 * STAGE.parameters["arm_inertia"]}
    )
    recording = stage_recording(other, seed=4, seconds=12.0, rms=0.15, band=(0.2, 6.0))
    record = record_from(load_dataset(recording, STAGE), commanded=True)
    elsewhere = fit_whole(here.model, there.noise, [record], free=(), iterations=20)
    again = fit_whole(here.model, elsewhere.noise, [record], iterations=30)
    wanted = again.log_likelihood - elsewhere.log_likelihood
    gained = reconciled(here, elsewhere, [record]).log_likelihood - elsewhere.log_likelihood
    assert 0.0 <= gained < 0.5 * wanted


def test_information_of_other_recordings_counts_like_them(fits):
    _, long, here, there, both = fits
    counted = fit_whole(here.model, there.noise, [long], known=here.information, iterations=30)
    std = 1.0 / np.sqrt(np.diag(both.information))
    for name, error in zip(both.free, std, strict=True):
        a, b = counted.model.parameter_values()[name], both.model.parameter_values()[name]
        assert abs(a - b) < 0.8 * error


@given(st.integers(0, 10_000))
def test_what_is_known_beside_a_parameter_is_the_marginal_information(seed):
    rng = np.random.default_rng(seed)
    square = rng.standard_normal((4, 7)) * 10.0 ** rng.uniform(-2, 2, (4, 1))
    names = ("a", "b", "c", "d")
    fit = replace(fit_of(), free=names, information=square @ square.T)
    known = known_beside(fit, ("b", "d"))
    rest = [0, 2]
    expected = np.linalg.inv(np.linalg.inv(fit.information)[np.ix_(rest, rest)])
    assert known[np.ix_(rest, rest)] == pytest.approx(expected, rel=1e-6)
    assert not known[[1, 3]].any()
    assert not known[:, [1, 3]].any()
