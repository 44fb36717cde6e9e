"""With which speed a record begins that was cut out of a motion."""

from dataclasses import replace

import numpy as np
import pytest
from stepped_machines import DT, RIGID

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.diagnosis.evidence.null_records import null_record
from haptic_teleop_sysid.estimation import first_state
from haptic_teleop_sysid.estimation.first_state import from_first_state
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import innovations
from haptic_teleop_sysid.estimation.records import Record, piece
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch

STEP = 2.0 * np.pi / 65536


def turning(seed, seconds=12.0):
    """A record of a body that turns as the model has it, and its speed, by the exact step of a held input."""
    rng = np.random.default_rng(seed)
    count = round(seconds / DT)
    inertia, damping = RIGID.parameters["motor_inertia"], RIGID.parameters["motor_damping"]
    constant = RIGID.parameters["torque_constant"]
    torque = np.repeat(rng.uniform(-1.0, 1.0, count // 100 + 1), 100)[:count]
    rate = damping / inertia
    fades = np.exp(-rate * DT)
    angle = speed = 0.0
    angles, speeds = np.empty(count), np.empty(count)
    for k in range(count):
        angles[k], speeds[k] = angle, speed
        final = torque[k] / damping
        angle += final * DT + (speed - final) * (1.0 - fades) / rate
        speed = final + (speed - final) * fades
    measured = np.full((count, 2), np.nan)
    measured[:, 0] = STEP * np.round((angles + 0.3 * STEP * rng.standard_normal(count)) / STEP)
    record = Record("made", DT, torque / constant, measured, np.zeros(count), (STEP, 1.0))
    return record, speeds


@pytest.fixture(scope="module")
def moving():
    whole, speeds = turning(3)
    cut = round(6.3 / DT)
    part = piece(whole, cut, len(whole))
    fit = fit_from_scratch(RIGID, [whole])
    return fit, whole, part, speeds[cut]


def surprise(fit: Fit, record: Record) -> float:
    """Rms of the innovations in the first half second, relative to what they are in the second half."""
    found = innovations(pack(fit.model), fit.noise, record).innovation[:, 0]
    first = found[: round(0.5 / DT)]
    return float(np.sqrt(np.mean(first**2) / np.mean(found[len(found) // 2 :] ** 2)))


@pytest.mark.parametrize("wrong", [0.2, -3.0])
def test_a_wrong_first_speed_is_made_right(moving, wrong):
    fit, _, part, truth = moving
    begun = replace(part, rates=(truth + wrong, truth + wrong))
    assert surprise(fit, begun) > 2.0
    (found,) = from_first_state(fit, [begun])
    assert found.rates[0] == pytest.approx(truth, abs=0.02)
    assert abs(found.offsets[0]) < 2.0 * STEP
    assert surprise(fit, found) < 1.2


def test_what_begins_as_it_says_stays(moving):
    fit, whole, *_ = moving
    records = [whole]
    assert from_first_state(fit, records) is records


def test_what_rests_for_certain_is_not_asked(moving):
    fit, _, part, truth = moving
    records = [replace(part, at_rest=True, rates=(truth + 3.0, truth + 3.0))]
    assert from_first_state(fit, records) is records


def test_missing_readings_say_nothing(moving):
    fit, _, part, truth = moving
    measured = part.measured.copy()
    measured[5:40:3] = np.nan
    begun = replace(part, measured=measured, rates=(truth + 1.0, truth + 1.0))
    (found,) = from_first_state(fit, [begun])
    assert found.rates[0] == pytest.approx(truth, abs=0.03)


def test_the_beginning_of_a_record_begins_as_it_does_and_another_part_does_not(moving):
    _, _, part, truth = moving
    begun = replace(part, rates=(truth, truth), offsets=(0.01, 0.01))
    first = piece(begun, 0, 1000)
    assert (first.rates, first.offsets) == (begun.rates, begun.offsets)
    later = piece(begun, 1000, 2000)
    assert later.offsets == (0.0, 0.0) and later.rates != begun.rates
    assert piece(begun, 0, 1000, at_rest=True).initial_state()[2:].tolist() == [0.0, 0.0]


def test_a_recording_of_the_model_begins_where_it_is_read(moving):
    fit, _, part, truth = moving
    begun = replace(part, rates=(truth, truth), offsets=(0.01, 0.01))
    made = null_record(fit, fit.noise, begun, np.random.default_rng(1))
    assert made.measured[0, 0] == pytest.approx(begun.initial_state()[0], abs=3.0 * STEP)
    assert made.initial_state()[0] == made.measured[0, 0]


def test_friction_that_makes_it_worse_leaves_it_as_it_was(moving, monkeypatch):
    """What a linear step promises has to be so."""
    fit, _, part, truth = moving
    begun = replace(part, rates=(truth + 1.0, truth + 1.0))
    wanted = first_state._wanted
    monkeypatch.setattr(first_state, "_wanted", lambda *asked: -wanted(*asked))
    records = [begun]
    assert from_first_state(fit, records) is records
