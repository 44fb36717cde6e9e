"""Widths of contact are in units of the recording: metres, turns and volts are judged as radians are."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_rigs import MODEL, joint_record

from haptic_teleop_sim.effects import EFFECTS
from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.hypotheses.candidates import contacts, starts
from haptic_teleop_sysid.diagnosis.hypotheses.material import material
from haptic_teleop_sysid.diagnosis.inputs.scales import (
    recording_scales,
    within_reach,
)
from haptic_teleop_sysid.estimation.step_limits import bounds

FRICTION = Effect("coulomb_friction", "stage1_motor", {"torque": 0.1})
CONSTANT = {"torque_constant": MODEL.parameters["torque_constant"]}
NAME = "stage1_motor.coulomb_friction.contact_angle"


@pytest.fixture(scope="module")
def record():
    return joint_record(41, seconds=4.0)


def in_unit(model, factor):
    """The same model for such a recording: its input stays what it was."""
    return replace(model, parameters={n: v / factor for n, v in model.parameters.items()} | CONSTANT)


def in_units(record, factor):
    """The same recording in a unit that is 1/factor of a radian."""
    return replace(
        record, measured=factor * record.measured, resolution=tuple(factor * r for r in record.resolution)
    )


@pytest.mark.parametrize("factor", [1e-4, 1.0, 1e4])
def test_contacts_scale_with_the_unit(record, factor):
    scales = recording_scales(in_unit(MODEL, factor), [in_units(record, factor)])
    travel = factor * np.ptp(record.measured[:, 0])
    tried = [e.parameters["contact_angle"] for e in contacts(FRICTION, scales)]
    np.testing.assert_allclose(tried, np.array([2e-6, 2e-5, 2e-4]) * travel)
    low, high = within_reach(MODEL, scales)[NAME]
    np.testing.assert_allclose((low, high), np.array([1e-6, 1e-3]) * travel)
    assert all(low < t < high for t in tried)
    # The effect itself allows them.
    allowed = bounds(MODEL.with_effects(contacts(FRICTION, scales)[0]), (NAME,), within_reach(MODEL, scales))
    np.testing.assert_allclose([a[0] for a in allowed], (low, high))
    # A linearisation begins with a contact of this recording, too.
    for one in starts(EFFECTS["coulomb_friction"], scales, "motor"):
        assert low <= FRICTION.values["contact_angle"] <= high or low < one["contact_angle"] < high


@pytest.mark.parametrize("factor", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize(("share", "expected"), [(1e-4, False), (0.01, True), (0.7, True), (1.5, False)])
def test_a_contact_bears_its_own_name_from_a_share_of_the_travel(record, factor, share, expected):
    scales = recording_scales(MODEL, [in_units(record, factor)])
    stiffness = 0.5 / (share * scales.span(0))
    effect = Effect("presliding_friction", "stage1_motor", {"torque": 0.5, "stiffness": stiffness})
    assert material(effect, scales) == expected


def test_within_a_step_of_the_encoder_no_contact_shows(record):
    coarse = replace(record, resolution=(0.01 * np.ptp(record.measured[:, 0]), record.resolution[1]))
    scales = recording_scales(MODEL, [coarse])
    assert scales.contacts(0)[1] == pytest.approx(coarse.resolution[0])
    gives = 0.5 * coarse.resolution[0]
    effect = Effect("presliding_friction", "stage1_motor", {"torque": 0.5, "stiffness": 0.5 / gives})
    assert not material(effect, scales)
    assert material(effect, recording_scales(MODEL, [record]))


def test_an_arm_that_nobody_read_has_the_motor_s_travel(record):
    alone = replace(record, measured=np.column_stack([record.measured[:, 0], np.full(len(record), np.nan)]))
    scales = recording_scales(MODEL, [alone])
    assert scales.contacts(1)[0] == pytest.approx(scales.contacts(0)[0])


def test_no_contact_is_stiffer_than_samples_can_show(record):
    """On a contact that bears the rms torque the joint swings by 20 rad a sample at most: a recording at a
    tenth of the rate would need ten times as many steps of the simulation and show no more of it."""
    slow = replace(record, dt=10.0 * record.dt)
    scales = recording_scales(MODEL, [slow])
    least, most = scales.contacts(0)
    inertia = MODEL.parameters["motor_inertia"]
    assert slow.dt * np.sqrt(scales.size["torque"] / least / inertia) == pytest.approx(20.0)
    assert least < scales.contact_starts(0)[0] < scales.contact_starts(0)[-1] < most
    assert recording_scales(MODEL, [record]).contacts(0)[0] == pytest.approx(1e-6 * scales.span(0))
