"""What an encoder reads wrong over the angle is drawn, and told from torques over it; the joint is stepped
here."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import DT, FINE, RIGID, drive, record

from haptic_teleop_sysid.diagnosis.decision.unknown.encoder_error import read_wrong
from haptic_teleop_sysid.diagnosis.decision.verdict import Verdict
from haptic_teleop_sysid.diagnosis.evidence.measured_map import no_torque
from haptic_teleop_sysid.diagnosis.evidence.proof import Course
from haptic_teleop_sysid.diagnosis.evidence.reading_error import reading_error
from haptic_teleop_sysid.diagnosis.evidence.true_readings import with_true_readings
from haptic_teleop_sysid.diagnosis.report.page_reading import reading_section
from haptic_teleop_sysid.estimation.whole_fit import fit_whole, noise_starts
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.report import Page

INERTIA, DAMPING, CUTOFF = 0.14, 0.35, 8.0


def moved(command, coulomb=0.0, spring=lambda q: 0.0, varies=0.0):
    """Torques and angles (n,) of a mass with smooth dry friction and a torque over the angle, held near zero
    by a controller; its inertia ``varies`` five times a turn by that share."""
    q, v, h, torque, found = 0.0, 0.0, DT / FINE, command.copy(), np.empty(len(command))
    for k in range(len(command)):
        found[k] = q
        torque[k] -= 2.0 * q
        for _ in range(FINE):
            inertia = INERTIA * (1.0 + varies * np.sin(5.0 * q))
            turning = 0.5 * INERTIA * varies * 5.0 * np.cos(5.0 * q) * v**2
            rub = coulomb * np.tanh(v / 1e-3)
            v += h * (torque[k] - DAMPING * v - rub - spring(q) - turning) / inertia
            q += h * v
    return torque, found


def loaded(q):
    """A reading that is not straight: 0.1 rad too much and too little over the travel."""
    return q + 0.1 * np.sin(2.1 * q + 0.3)


READINGS = {
    "loaded": loaded,
    "tanh": lambda q: np.tanh(0.6 * q) / 0.6,
    "cubic": lambda q: q + 0.12 * q**3,
}


def recordings(read=lambda q: q, **parts):
    both = [moved(drive(seed, 2.0), **parts) for seed in (0, 1)]
    return [[record(torque, read(angle)[:, None], 1e-5)] for torque, angle in both]


def drawn(kinds, model=RIGID, named=()):
    return reading_error(model, named, *kinds, CUTOFF)


@pytest.mark.parametrize(("reading", "coulomb"), [(name, 0.0) for name in READINGS] + [("loaded", 0.2)])
def test_the_curve_of_a_reading_is_drawn_beside_friction(reading, coulomb):
    found = drawn(recordings(READINGS[reading], coulomb=coulomb))
    assert found.location == "j_motor_encoder"
    assert found.explained > 0.9 > found.by_torque
    # The corrected reading is the angle but for a scale and an offset.
    angles = np.linspace(-3.0, 3.0, 4001)
    angle = np.interp(found.angle, READINGS[reading](angles), angles)
    true = found.true(found.angle)
    left = true - np.polyval(np.polyfit(angle, true, 1), angle)
    bent = found.angle - np.polyval(np.polyfit(angle, found.angle, 1), angle)
    assert np.sqrt(np.mean(left**2)) < 0.06 * np.sqrt(np.mean(bent**2))


def test_the_models_own_numbers_do_not_matter():
    kinds = recordings(loaded)
    right = drawn(kinds)
    for changed in ({"motor_damping": 0.0}, {"motor_damping": 3.0}, {"motor_inertia": 0.4}):
        found = drawn(kinds, RIGID.with_values(changed))
        assert found.error == pytest.approx(right.error, abs=0.1 * right.largest)


def test_a_fixed_inertia_keeps_nothing_from_being_drawn():
    fixed = replace(RIGID, fixed=(*RIGID.fixed, "motor_inertia"))
    assert drawn(recordings(loaded), fixed.with_values({"motor_inertia": INERTIA})) is not None


@pytest.mark.parametrize(
    "parts",
    [
        {"coulomb": 0.3},
        {"spring": lambda q: 0.8 * q + 0.9 * np.sin(2.3 * q)},
        {"spring": lambda q: 0.5 * q**2 + 0.4 * q**3},
        {"coulomb": 0.1, "spring": lambda q: 0.6 * np.tanh(q / 0.05)},
        {"varies": 0.4},
        {"varies": 0.4, "coulomb": 0.2},
    ],
)
def test_a_torque_is_none(parts):
    assert drawn(recordings(**parts)) is None


def test_where_recordings_do_not_meet_nothing_is_drawn():
    here, there = recordings(loaded)
    far = [replace(there[0], measured=there[0].measured + 9.0)]
    assert drawn([here, far]) is None
    unread = [replace(there[0], measured=np.full_like(there[0].measured, np.nan))]
    assert drawn([here, unread]) is None


def told(kinds, named=()):
    fit = fit_whole(RIGID, noise_starts(RIGID, kinds[0])[1], kinds[0], iterations=5)
    course = Course.of(fit.model, [data_of(r) for kind in kinds for r in kind])
    where = {"equation": "j_motor", "share": 1.0, "condition": "time", "intervals": []}
    return read_wrong(Verdict("unknown", [where], [], [], []), fit, tuple(kinds), CUTOFF, course, 1)


def test_the_verdict_and_what_is_said_in_place_of_a_map():
    after, wrong = told(recordings(loaded))
    assert after.where[0]["equation"] == "j_motor_encoder"
    assert after.where[0]["condition"] == "motor angle" and after.where[0]["share"] > 0.9
    assert f"up to {wrong.error.largest:.2g} rad" in no_torque("j_motor_encoder", wrong.error).why
    content = wrong.content()
    assert len(content["reading"]) == len(content["error"]) and content["unit"] == "rad"
    assert content["fit"]["corrected"] > content["fit"]["as_read"] + 3.0
    after, wrong = told(recordings(spring=lambda q: 0.8 * q + 0.9 * np.sin(2.3 * q)))
    assert after.where[0]["equation"] == "j_motor" and wrong is None


def test_the_page_shows_the_error_and_what_to_do_about_it():
    _, wrong = told(recordings(loaded))
    page = Page("made here", "")
    units = Units()
    reading_section(page, {"reading_error": wrong.content()}, units)
    html = page.render()
    assert "What the encoder reads wrong" in html and f"{wrong.worth.corrected:.1f} instead of" in html
    reading_section(empty := Page("made here", ""), {}, units)
    assert "What the encoder reads wrong" not in empty.render()


def test_a_correction_by_it_is_worth_what_it_takes_from_the_errors():
    found = drawn(recordings(loaded))
    learn, judge = recordings(loaded)
    fit = fit_whole(RIGID, noise_starts(RIGID, learn)[1], learn, iterations=5)
    data = [data_of(r) for r in (*learn, *judge)]
    course = Course.of(fit.model, data)
    worth = with_true_readings(found, fit, [], learn, course, 1)
    assert worth.corrected > 95.0 and worth.corrected > worth.as_read + 3.0
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
