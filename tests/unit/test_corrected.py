"""An error of an encoder is in every equation with its angle; that of a gear is not in their sum.

The machine is stepped here, with a joint like a cardan's or a harmonic drive's: its output is ahead and
behind by a sine of the motor's angle, which is a torque of the spring and no error of a reading."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from stepped_machines import DT, ELASTIC, FINE, drive, record

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.decision.name_tests.place import misplaced
from haptic_teleop_sysid.diagnosis.decision.search.decide import Choice
from haptic_teleop_sysid.diagnosis.decision.search.rounds import SearchResult
from haptic_teleop_sysid.diagnosis.evidence.acting_place import ActingPlace
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.corrected import corrected
from haptic_teleop_sysid.diagnosis.hypotheses.explanation import Explanation
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts

STIFFNESS, MOTOR, ARM = 20.0, (0.06, 0.3), (0.1, 0.1)
CUTOFF = 8.0
SIZE, ORDER, LATE = 0.03, 3.0, 0.006


@njit
def geared(torque, ahead, order, coulomb):
    """Angles (n, 2) of two masses; the spring's end at the motor is ``ahead`` sin(order q) ahead of it."""
    q, h, found = np.zeros(4), DT / FINE, np.empty((len(torque), 2))
    for k in range(len(torque)):
        found[k, 0], found[k, 1] = q[0], q[1]
        for _ in range(FINE):
            spring = STIFFNESS * (q[0] + ahead * np.sin(order * q[0]) - q[1])
            rub = coulomb * np.tanh(q[2] / 1e-3)
            q[2] += h * (torque[k] - MOTOR[1] * q[2] - spring - rub) / MOTOR[0]
            q[3] += h * (spring - ARM[1] * q[3]) / ARM[0]
            q[0] += h * q[2]
            q[1] += h * q[3]
    return found


ERRORS = {
    "encoder_eccentricity": lambda q: q + SIZE * np.sin(ORDER * q),
    "encoder_scale": lambda q: 1.03 * q,
    "sensor_delay": lambda q: np.concatenate([np.full(3, q[0]), q[:-3]]),
}
NUMBERS = {
    "encoder_eccentricity": {"amplitude": SIZE, "order": ORDER, "phase": 0.0},
    "encoder_scale": {"scale": 1.03},
    "sensor_delay": {"delay": LATE},
}


def machine(seed, ahead=0.0, error=None, encoder=0, coulomb=0.0):
    torque = drive(seed, 2.0)
    found = geared(torque, ahead, ORDER, coulomb)
    if error:
        found[:, encoder] = ERRORS[error](found[:, encoder])
    return record(torque, found, 1e-5)


def asks(**parts):
    return ActingPlace(ELASTIC, [machine(seed, **parts) for seed in (0, 1)], CUTOFF)


def named(error, encoder):
    place = ("motor_encoder", "arm_encoder")[encoder]
    return Effect(error, f"j_{place}", NUMBERS[error])


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("encoder", [0, 1])
def test_an_error_that_is_there_makes_no_equation_worse(error, encoder):
    assert asks(error=error, encoder=encoder).held_worse(named(error, encoder), ()) is None
    rubbed = asks(error=error, encoder=encoder, coulomb=0.3)
    friction = Effect("coulomb_friction", "j_motor", {"torque": 0.3})
    assert rubbed.held_worse(named(error, encoder), [friction]) is None


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("encoder", [0, 1])
def test_without_its_error_a_reading_is_the_angle(error, encoder):
    wrong, right = machine(0, error=error, encoder=encoder), machine(0)
    read = corrected(wrong, named(error, encoder), encoder).measured
    assert read[: len(read) - 5] == pytest.approx(right.measured[: len(read) - 5], abs=3e-5)


def test_a_missing_reading_stays_missing_and_nothing_is_made_of_it():
    whole = machine(0, error="sensor_delay")
    holes = replace(whole, measured=whole.measured.copy())
    holes.measured[100:103, 0] = np.nan
    for effect in (named("sensor_delay", 0), named("encoder_eccentricity", 0)):
        with_holes, without = (corrected(r, effect, 0).measured[:, 0] for r in (holes, whole))
        assert np.array_equal(np.flatnonzero(np.isnan(with_holes)), [100, 101, 102])
        assert np.nanmax(np.abs(with_holes - without)) < 2e-3


def result_of(acting, effect):
    baseline = fit_whole(ELASTIC, noise_starts(ELASTIC, acting.records)[1], acting.records, iterations=3)
    fit = replace(baseline, model=ELASTIC.with_effects(effect))
    choices = (Choice(Explanation(fit, 90.0, 50.0, True, 0), 0.9),)
    return SearchResult(baseline, fit, choices, (), recording_scales(ELASTIC, acting.records))


def test_the_error_of_a_gear_is_none_of_the_encoder_and_the_name_goes():
    acting = asks(ahead=SIZE)
    # Seen from the spring a motor that reads too little.
    numbers = NUMBERS["encoder_eccentricity"] | {"phase": np.pi}
    error = Effect("encoder_eccentricity", "j_motor_encoder", numbers)
    assert acting.held_worse(error, ()) == "joint"
    result, doubt = misplaced(result_of(acting, error), acting, acting.records)
    assert not result.choices and "corrected by it" in doubt.why and "j_joint" in doubt.why


def test_the_name_of_an_error_that_is_there_stays():
    acting = asks(error="encoder_eccentricity")
    result, doubt = misplaced(result_of(acting, named("encoder_eccentricity", 0)), acting, acting.records)
    assert len(result.choices) == 1 and doubt is None


@pytest.mark.parametrize("error", ERRORS)
def test_two_encoders_that_err_alike_keep_both_names(error):
    records = []
    for seed in (0, 1):
        torque = drive(seed, 2.0)
        found = geared(torque, 0.0, ORDER, 0.0)
        records.append(record(torque, np.column_stack([ERRORS[error](q) for q in found.T]), 1e-5))
    acting = ActingPlace(ELASTIC, records, CUTOFF)
    both = [named(error, encoder) for encoder in (0, 1)]
    assert [acting.held_worse(one, [other]) for one, other in (both, both[::-1])] == [None, None]
    unread = [replace(r, measured=np.full_like(r.measured, np.nan)) for r in records]
    assert ActingPlace(ELASTIC, unread, CUTOFF).held_worse(both[0], []) is None
