"""What an encoder reads wrong over the angle is drawn, and told from torques over it; the joint is stepped
here."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import DT, FINE, RIGID, drive, record

from haptic_teleop_sysid.diagnosis.decision.read_wrong import read_wrong
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.measured_map import no_torque
from haptic_teleop_sysid.diagnosis.evidence.proof import Course
from haptic_teleop_sysid.diagnosis.evidence.reading_error import reading_error
from haptic_teleop_sysid.diagnosis.evidence.true_readings import with_true_readings
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts
from haptic_teleop_sysid.recordings.dataset import DataSet

INERTIA, DAMPING, CUTOFF = 0.14, 0.35, 8.0


def moved(command, coulomb=0.0, spring=lambda q: 0.0):
    """Torques and angles (n,) of a mass with smooth dry friction and a torque over the angle, held near zero
    by a controller."""
    q, v, h, torque, found = 0.0, 0.0, DT / FINE, command.copy(), np.empty(len(command))
    for k in range(len(command)):
        found[k] = q
        torque[k] -= 2.0 * q
        for _ in range(FINE):
            v += h * (torque[k] - DAMPING * v - coulomb * np.tanh(v / 1e-3) - spring(q)) / INERTIA
            q += h * v
    return torque, found


def loaded(q):
    """A reading that is not straight: 0.1 rad too much and too little over the travel."""
    return q + 0.1 * np.sin(2.1 * q + 0.3)


def recordings(read=lambda q: q, **parts):
    both = [moved(drive(seed, 2.0), **parts) for seed in (0, 1)]
    return [[record(torque, read(angle)[:, None], 1e-5)] for torque, angle in both]


def beyond_a_line(angle, values):
    return values - np.polyval(np.polyfit(angle, values, 1), angle)


@pytest.mark.parametrize("coulomb", [0.0, 0.2])
def test_the_curve_of_a_reading_is_drawn_beside_friction(coulomb):
    found = reading_error(RIGID, *recordings(loaded, coulomb=coulomb), CUTOFF)
    assert found.location == "j_motor_encoder"
    assert found.explained > 0.95 > 0.8 > found.by_torque
    angles = np.linspace(-6.0, 6.0, 4001)
    error = beyond_a_line(found.angle, np.interp(found.angle, loaded(angles), loaded(angles) - angles))
    assert found.error == pytest.approx(error, abs=0.2 * np.max(np.abs(error)))


@pytest.mark.parametrize(
    "parts",
    [
        {},
        {"coulomb": 0.3},
        {"spring": lambda q: 0.8 * q + 0.9 * np.sin(2.3 * q)},
        {"spring": lambda q: 0.5 * q**2 + 0.4 * q**3},
        {"coulomb": 0.1, "spring": lambda q: 0.6 * np.tanh(q / 0.05)},
    ],
)
def test_a_torque_is_none(parts):
    assert reading_error(RIGID, *recordings(**parts), CUTOFF) is None


def test_the_verdict_and_what_is_said_in_place_of_a_map():
    found = reading_error(RIGID, *recordings(loaded), CUTOFF)
    where = {"equation": "j_motor", "share": 1.0, "condition": "time", "intervals": []}
    before = Verdict("unknown", [where], [], [], [])
    after, place = read_wrong(before, found)
    assert place == after.where[0]["equation"] == "j_motor_encoder"
    assert after.where[0]["condition"] == "motor angle" and after.where[0]["share"] > 0.9
    assert f"up to {found.largest:.2g} rad" in no_torque(place, found).why
    content = found.content(None)
    assert len(content["angle"]) == len(content["error"]) and content["unit"] == "rad"


def test_a_correction_by_it_is_worth_what_it_takes_from_the_errors():
    found = reading_error(RIGID, *recordings(loaded), CUTOFF)
    learn, judge = recordings(loaded)
    fit = fit_whole(RIGID, noise_starts(RIGID, learn)[1], learn, iterations=5)
    data = [data_of(r) for r in (*learn, *judge)]
    course = Course.of(fit.model, data)
    worth = with_true_readings(found, fit, [], learn, course, 1)
    assert worth.corrected > 95.0 and worth.corrected > worth.as_read + 5.0
    assert f"{worth.corrected:.1f} instead of {worth.as_read:.1f} %" in worth.content()["what"]
    spoilt = replace(found, error=-found.error)
    assert with_true_readings(spoilt, fit, [], learn, course, 1).corrected < worth.as_read


def data_of(read):
    angle = read.measured[:, 0]
    return DataSet(
        "made here",
        "generic",
        "j",
        read.dt,
        read.input,
        "N*m",
        "effort",
        angle,
        np.gradient(angle, read.dt),
        valid=np.ones(len(angle), dtype=bool),
    )
