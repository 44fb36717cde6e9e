"""How steadily recordings speak for a name: by blocks of their likelihood."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, explanation, fit_of, joint_record, result_of

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.finding import finding
from haptic_teleop_sysid.diagnosis.decision.name_tests.measured_input import of_measured_input
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice, choose
from haptic_teleop_sysid.diagnosis.evidence.by_blocks import BLOCKS, by_blocks, chance, seen_steadily
from haptic_teleop_sysid.estimation.likelihood import likelihood_of
from haptic_teleop_sysid.estimation.prediction_fit import fit_parameters
from haptic_teleop_sysid.estimation.tuning import initial_noise

NONE = np.zeros((2, BLOCKS))


def steady(nats, spread=0.0, seed=1):
    """Blocks of two recordings that make ``nats`` in all, each scattering by ``spread``."""
    noise = np.random.default_rng(seed).standard_normal((2, BLOCKS))
    noise -= noise.mean()
    return nats / NONE.size + spread * noise / noise.std()


def told(name, gain, blocks, **parameters):
    one = explanation(name, gain / 2.0, gain / 2.0, **parameters)
    return replace(one, gains=blocks)


def test_blocks_add_up_to_the_likelihood():
    record = joint_record(3)
    fit = fit_parameters(MODEL, initial_noise(pack(MODEL), [record]), [record], iterations=1)
    found = by_blocks([(fit, [record])])
    count = record.measured.shape[0]
    # The quadratic part of Gaussian innovations with their own covariance is half a nat per reading.
    whole = likelihood_of(pack(fit.model), fit.noise, [record])
    assert found.shape == (1, BLOCKS)
    assert found.sum() == pytest.approx(whole - 0.5 * 2 * count, rel=0.02)


def every_fifth(measured):
    measured[np.arange(len(measured)) % 5 != 0, 1] = np.nan


def in_turn(measured):
    measured[::2, 0] = measured[1::2, 1] = np.nan


@pytest.mark.parametrize(
    ("lost", "delay"), [(None, 0.0), (None, 0.05), (every_fifth, 0.0), (in_turn, 0.0), (every_fifth, 0.05)]
)
def test_blocks_differ_as_likelihoods_do_where_an_encoder_is_late_or_readings_are_missing(lost, delay):
    record = joint_record(3)
    measured = record.measured.copy()
    if lost is not None:
        lost(measured)
    record = replace(record, measured=measured)
    noise = initial_noise(pack(MODEL), [record])
    late = Effect("sensor_delay", "stage1_arm_encoder", {"delay": delay})
    other = MODEL.with_values({"motor_damping": 1.2 * MODEL.parameters["motor_damping"]})
    models = MODEL, (other.with_effects(late) if delay else other)
    one, two = (by_blocks([(replace(fit_of(m), noise=noise), [record])]) for m in models)
    a, b = (likelihood_of(pack(m), noise, [record]) for m in models)
    # A late encoder has some readings fewer, each of half a nat.
    assert (one - two).sum() == pytest.approx(a - b, abs=0.01 + 0.5 * np.ceil(delay / record.dt))


def test_what_cannot_be_predicted_has_no_blocks():
    nowhere = fit_of()
    silent = replace(nowhere, noise=replace(nowhere.noise, motor_angle=0.0))
    assert by_blocks([(silent, [joint_record(3)])]) is None
    assert chance(None, NONE) is None
    assert seen_steadily(50.0, None) == 1.0


def test_the_error_is_that_of_a_sum_over_blocks():
    rng = np.random.default_rng(4)
    sums, errors = [], []
    for _ in range(400):
        one = rng.normal(3.0, 2.0, (2, BLOCKS))
        sums.append(one.sum())
        errors.append(chance(one))
    assert np.mean(errors) == pytest.approx(np.std(sums), rel=0.1)


def test_what_shows_once_is_less_sure_than_what_shows_all_the_time():
    once = NONE.copy()
    once[0, 7] = 200.0
    assert seen_steadily(200.0, once) == pytest.approx(0.84, abs=0.01)
    assert seen_steadily(200.0, steady(200.0, 1.0)) > 0.999


def test_rivals_whose_lead_scatters_stay_open():
    best = told("actuator_lag", 300.0, steady(300.0), place="actuator", time_constant=0.02)
    for spread, ambiguous in ((0.5, False), (8.0, True)):
        rival = told("torque_ripple", 270.0, steady(270.0, spread), amplitude=0.1, order=3.0, phase=0.1)
        choice = choose([best, rival], 0.0, False)
        assert choice.chosen is best
        assert choice.ambiguous == ambiguous, spread


def test_of_a_plain_and_a_richer_form_the_likelier_comes_first_and_within_chance_both_stay_open():
    plain = told("coulomb_friction", 300.0, steady(300.0))
    sought = {"torque": 0.1, "amplitude": 0.04, "order": 1.7, "phase": -0.4}
    for spread, ambiguous in ((1.0, False), (6.0, True)):
        rich = told("position_dependent_friction", 330.0, steady(330.0, spread), **sought)
        choice = choose([rich, plain], 0.0, False)
        assert choice.chosen is rich and choice.ambiguous == ambiguous, spread
    # What its parameters gain by chance does not count for it.
    hardly = told("position_dependent_friction", 306.0, steady(306.0, 6.0), **sought)
    assert choose([hardly, plain], 0.0, False).chosen is plain
    # What simulates clearly better speaks for itself.
    better = lambda model: 90.0 if model is plain.fit.model else 40.0  # noqa: E731
    assert choose([rich, plain], 0.0, False, percent=better).chosen is plain


def test_a_confidence_is_no_higher_than_the_blocks_allow():
    once = NONE.copy()
    once[1, 2] = 90.0
    for blocks, most, why in ((steady(90.0, 0.1), 0.95, False), (once, 0.85, True)):
        one = told("coulomb_friction", 90.0, blocks)
        said = finding(Choice(one, 1.0), one.fit, {})
        assert said["confidence"] == pytest.approx(most, abs=0.02)
        assert ("do not speak for it all the time" in said["because"]) == why
        assert said["because"].count(".;") == 0


@pytest.mark.parametrize(
    ("name", "numbers", "unsure"),
    [
        ("torque_speed_limit", {"limit": 1.0, "slope": 0.1}, True),
        ("torque_saturation", {"limit": 1.0}, True),
        ("actuator_lag", {"time_constant": 0.01}, False),
    ],
)
def test_a_limit_of_the_command_is_not_sure_where_the_input_may_be_the_current(name, numbers, unsure):
    limit = Choice(explanation(name, 200.0, 100.0, "actuator", **numbers), 1.0)
    log = SimpleNamespace(commanded_input=None)
    (held,), (read,) = (of_measured_input(result_of(limit), was, [log]).choices for was in (False, True))
    assert held.unsure == ""
    assert ("record the command" in read.unsure) == unsure
    by_current = replace(limit, chosen=replace(limit.chosen, by_current=50.0))
    assert of_measured_input(result_of(by_current), True, [log]).choices[0].unsure == ""
    both = SimpleNamespace(commanded_input=np.zeros(3))
    assert of_measured_input(result_of(limit), True, [both]).choices[0].unsure == ""
