"""What a share of the input is, is told from what the motion makes: an amplifier that loses commands from a
bearing that rubs at times. The joint is stepped by the matrix exponential."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, multisine
from scipy.linalg import expm

from haptic_teleop_sysid.diagnosis.decision.at_the_actuator import WITH_THE_INPUT, at_the_actuator
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.in_proportion import INPUT, in_proportion, with_the_input
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

DT, SECONDS = 0.002, 16.0
STEP = 1e-5
"""rad per step of the encoders."""


def stretches(seed, share=0.15):
    """Which samples (n,) are in one of some stretches of 0.1 to 0.4 s."""
    random, found = np.random.default_rng(seed), np.zeros(round(SECONDS / DT), dtype=bool)
    while found.mean() < share:
        start = random.integers(len(found))
        found[start : start + random.integers(50, 200)] = True
    return found


def record(seed, missing):
    """A joint that ``missing`` (input A, motor speed, number of the sample) -> N·m takes torque from."""
    p = STAGE.parameters
    k, jm, ja = p["stiffness"], p["motor_inertia"], p["arm_inertia"]
    bm, ba = p["motor_damping"], p["arm_damping"]
    a, b = np.zeros((4, 4)), np.array([[0.0], [0.0], [1.0 / jm], [0.0]])
    a[:2, 2:], a[2] = np.eye(2), [-k / jm, k / jm, -bm / jm, 0.0]
    a[3] = [k / ja, -k / ja, 0.0, -ba / ja]
    step = expm(DT * np.block([[a, b], [np.zeros((1, 5))]]))
    n = round(SECONDS / DT)
    current = multisine(n, DT, 0.15, (0.2, 5.0), seed)
    random = np.random.default_rng(seed)
    x, angles = np.zeros(4), np.empty((n, 2))
    for i in range(n):
        angles[i] = x[:2]
        torque = p["torque_constant"] * current[i] + 0.01 * random.standard_normal()
        x = step[:4, :4] @ x + step[:4, 4] * (torque - missing(current[i], x[2], i))
    read = STEP * np.round(angles / STEP)
    return Record("joint", DT, current, read, np.zeros(n), (STEP, STEP), at_rest=True)


def fitted(one):
    return fit_whole(STAGE, noise_starts(STAGE, [one])[0], [one])


def lost(seed):
    """Half of the command is lost at times."""
    at = stretches(seed)
    return record(seed, lambda current, speed, i: 0.5 * STAGE.parameters["torque_constant"] * current * at[i])


def rubs(seed):
    """Something rubs at times."""
    at = stretches(seed)
    return record(seed, lambda current, speed, i: 0.15 * np.sign(speed) * at[i])


@pytest.fixture(scope="module")
def losing():
    here, elsewhere = lost(1), lost(2)
    return here, elsewhere, fitted(here)


@pytest.fixture(scope="module")
def rubbing():
    here, elsewhere = rubs(3), rubs(4)
    return here, elsewhere, fitted(here)


def unknown_at(place):
    where = {"equation": place, "share": 1.0, "condition": "time", "intervals": []}
    return Verdict("unknown", [where], [], [], [])


def test_commands_lost_at_times_are_a_share_of_the_input(losing):
    here, _, fit = losing
    gains = in_proportion([(fit, [here])])
    assert next(iter(gains)) == INPUT
    assert with_the_input(gains)


def test_readings_that_are_missing_do_not_hide_it(losing):
    here, _, fit = losing
    read = here.measured.copy()
    read[::7, 0] = np.nan
    read[::2, 1] = np.nan
    assert with_the_input(in_proportion([(fit, [replace(here, measured=read)])]))


def test_what_rubs_at_times_goes_with_the_direction(rubbing):
    here, _, fit = rubbing
    gains = in_proportion([(fit, [here])])
    assert next(iter(gains)) == "direction of motor velocity"
    assert not with_the_input(gains)


def test_of_nothing_no_quantity_gains_more_than_chance():
    one = record(5, lambda current, speed, i: 0.0)
    gains = in_proportion([(fitted(one), [one])])
    assert max(gains.values()) < 12.0


def test_a_share_that_never_changes_is_the_structures():
    weak = record(6, lambda current, speed, i: 0.3 * STAGE.parameters["torque_constant"] * current)
    assert not with_the_input(in_proportion([(fitted(weak), [weak])]))


def test_the_verdict_goes_to_the_actuator(losing):
    here, elsewhere, fit = losing
    found, gains = at_the_actuator(unknown_at("stage1_motor"), fit, [here], [elsewhere])
    assert found.where[0] | {"equation": "stage1_actuator", "condition": WITH_THE_INPUT} == found.where[0]
    assert next(iter(gains)) == INPUT


def test_what_rubs_stays_at_the_motor(rubbing):
    here, elsewhere, fit = rubbing
    before = unknown_at("stage1_motor")
    found, gains = at_the_actuator(before, fit, [here], [elsewhere])
    assert found is before
    assert gains


def test_beside_a_structure_that_ended_at_a_bound_nothing_is_asked(losing):
    here, elsewhere, fit = losing
    before = unknown_at("stage1_motor")
    stuck, frictionless = (replace(fit, at_bound=(name,)) for name in ("motor_inertia", "motor_damping"))
    assert at_the_actuator(before, stuck, [here], [elsewhere]) == (before, None)
    assert at_the_actuator(before, frictionless, [here], [elsewhere])[1]


def test_another_place_and_a_name_are_not_asked(losing):
    here, elsewhere, fit = losing
    at_the_arm, named = unknown_at("stage1_arm"), replace(unknown_at("stage1_motor"), kind="identified")
    for before in (at_the_arm, named):
        assert at_the_actuator(before, fit, [here], [elsewhere]) == (before, None)
