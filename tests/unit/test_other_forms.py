"""Sizes of a law that has several published forms: their standard errors hold for the machine, not only
for the form that was fitted."""

import math

import numpy as np
import pytest
from numba import njit
from stepped_machines import DT, FINE, RIGID, drive, record

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.evidence import other_forms
from haptic_teleop_sysid.diagnosis.evidence.certainty import standard_errors
from haptic_teleop_sysid.diagnosis.evidence.inverse_dynamics.band import motion_band
from haptic_teleop_sysid.diagnosis.evidence.other_forms import spread_by_form, together
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

SLIDING, BREAKAWAY, DAMPING = 0.2, 0.5, 0.35


@njit
def swing(torque, over):
    """Angles (n,) of a body whose friction falls with speed as a Gauss curve."""
    q, v, h = 0.0, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            drive = torque[k] - 0.35 * v
            if v == 0.0 and abs(drive) <= 0.5:
                continue
            before, side = v, math.copysign(1.0, v if v != 0.0 else drive)
            v += h * (drive - side * (0.2 + 0.3 * math.exp(-((v / over) ** 2)))) / 0.14
            if before * v < 0.0:
                v = 0.0
            q += h * v
    return found


def fitted(over, seed):
    """A fit by the form of this project to one recording, and the recording."""
    torque = drive(seed, 2.0)
    one = record(torque, swing(torque, over)[:, None], 1e-4)
    sizes = {"coulomb": 0.3, "breakaway": 0.45, "velocity": 0.5}
    return fit_from_scratch(RIGID.with_effects(Effect("stribeck_friction", "j_motor", sizes)), [one]), one


@pytest.mark.parametrize("over", [0.2, 1.0, 3.0])
def test_another_form_of_the_law_is_within_the_standard_errors_of_the_sizes(over):
    fit, one = fitted(over, 0)
    alone = standard_errors(fit)
    errors = together(alone, spread_by_form(fit.model, [one], motion_band([one])))
    values, head = fit.model.parameter_values(), "j_motor.stribeck_friction."
    truth = {head + "coulomb": SLIDING, head + "breakaway": BREAKAWAY, "motor_damping": DAMPING}
    assert all(abs(values[n] - t) < 2.0 * errors[n] for n, t in truth.items())
    # And what the one form alone says of them is far too sure.
    assert any(abs(values[n] - t) > 4.0 * alone[n] for n, t in truth.items()) or over == 3.0


def test_what_does_not_depend_on_the_form_stays_as_sure_as_it_was():
    fit, one = fitted(0.2, 0)
    spread = spread_by_form(fit.model, [one], motion_band([one]))
    # Far above its velocity the friction is what it is, in whatever form it falls.
    assert spread["j_motor.stribeck_friction.coulomb"] < 0.02 * SLIDING
    assert spread["motor_inertia"] < 1e-3 * 0.14
    plain = RIGID.with_effects(Effect("coulomb_friction", "j_motor", {"torque": 0.2}))
    assert spread_by_form(plain, [one], motion_band([one])) == {}


def test_a_regression_that_fails_ends_no_diagnosis(monkeypatch):
    def fails(*_):
        raise np.linalg.LinAlgError("singular")

    monkeypatch.setattr(other_forms, "equations", fails)
    sizes = {"coulomb": 0.3, "breakaway": 0.45, "velocity": 0.5}
    model = RIGID.with_effects(Effect("stribeck_friction", "j_motor", sizes))
    one = record(drive(0, 2.0), np.zeros((10_000, 1)))
    assert other_forms.spread_by_form(model, [one], 4.0) == {}


@njit
def against_a_wall(torque, wall, stiffness, damping):
    """Angles (n,) of a body that runs into a spring with a dashpot, which pushes and never pulls."""
    q, v, h = 0.0, 0.0, DT / FINE
    found = np.empty(len(torque))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            push = max(stiffness * (q - wall) + damping * v, 0.0) if q > wall else 0.0
            v += h * (torque[k] - 0.5 * v - 2.0 * q - push) / 0.05
            q += h * v
    return found


@pytest.mark.parametrize("damping", [0.5, 1.5])
def test_where_a_stop_begins_is_as_sure_as_the_law_of_its_contact(damping):
    torque = drive(3, 2.0)
    one = record(torque, against_a_wall(torque, 0.6, 100.0, damping)[:, None], 1e-4)
    found = {"angle": 0.58, "stiffness": 60.0, "dissipation": 1.0}
    model = RIGID.with_effects(
        Effect("hard_stop", "j_motor", found),
        Effect("spring_to_ground", "j_motor", {"stiffness": 2.0, "rest": 0.0}),
    )
    fit = fit_from_scratch(model, [one])
    alone, head = standard_errors(fit), "j_motor.hard_stop."
    spread = spread_by_form(fit.model, [one], motion_band([one]))
    off = abs(fit.model.parameter_values()[head + "angle"] - 0.6)
    assert off > 3.0 * alone[head + "angle"], "the one form alone is far too sure"
    assert off < 2.0 * together(alone, spread)[head + "angle"] < 0.03, "of a way of 0.08 rad beyond it"
    assert head + "stiffness" not in spread, "another law has its stiffness in another unit"
