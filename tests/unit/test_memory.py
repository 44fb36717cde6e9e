"""What is left that follows a quantity with a memory, and what only looks like it."""

import numpy as np
import pytest
import scipy
from stepped_machines import DT, RIGID, drive, record, swing

from haptic_teleop_sysid.diagnosis.decision.coloured import left_is_random, with_a_memory
from haptic_teleop_sysid.diagnosis.evidence.memory import remembered
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

TRUE = RIGID.with_values({"motor_inertia": 0.14, "motor_damping": 0.35})


def fitted(acts):
    """A fit of the structure alone to a joint on which ``acts``(command, seed) acts, and both recordings."""

    def made(seed):
        torque = drive(seed, 2.0)
        angle = swing(acts(torque, seed), 0.14, 0.35, 0.0, 0.0, 0.0, 0.0, 0.0)
        return [record(torque, angle[:, None], 1e-5)]

    learn, judge = made(0), made(1)
    return fit_whole(TRUE, noise_starts(TRUE, learn)[1], learn, iterations=8), learn, judge


def low_passed(values, time):
    share = DT / time
    return scipy.signal.lfilter([share], [1.0, share - 1.0], values)


def without_direct_current(torque, seed):
    """An amplifier that is coupled by a capacitor."""
    return torque - 0.9 * low_passed(torque, 0.5)


def with_random_torque(torque, seed):
    luck = np.random.default_rng(100 + seed).normal(size=len(torque))
    random = low_passed(luck, 0.15)
    return torque + 0.2 * np.std(torque) * random / np.std(random)


def test_what_an_amplifier_takes_away_with_a_memory_follows_the_input():
    fit, learn, judge = fitted(without_direct_current)
    found = with_a_memory(fit, learn, judge)
    assert (found.equation, found.name) == ("j_motor", "input torque") and found.explained > 0.8
    assert not left_is_random(fit, learn, judge)


def test_a_random_torque_of_the_same_size_follows_nothing():
    fit, learn, judge = fitted(with_random_torque)
    assert all(one.explained < 0.2 for one in remembered(fit, learn, judge, "j"))
    assert with_a_memory(fit, learn, judge) is None


@pytest.mark.parametrize("share", [0.0, 0.02])
def test_a_torque_that_is_as_small_as_chance_on_a_machine_is_not_asked_what_it_follows(share):
    fit, learn, judge = fitted(lambda torque, seed: torque - share * low_passed(torque, 0.15))
    assert with_a_memory(fit, learn, judge) is None
