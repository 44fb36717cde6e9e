"""Friction takes energy: sizes with which it would drive are none."""

import numpy as np
import pytest

from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.diagnosis.hypotheses.driving_friction import friction_drives
from haptic_teleop_sysid.diagnosis.hypotheses.material import material
from haptic_teleop_sysid.diagnosis.inputs.scales import recording_scales
from haptic_teleop_sysid.estimation.records import Record

PARAMETERS = {"torque_constant": 1.0, "motor_inertia": 0.2, "motor_damping": 0.3}
MODEL = Model("generic", "j", "rigid_body", PARAMETERS)


@pytest.fixture
def scales():
    time = 0.002 * np.arange(5000)
    measured = np.column_stack([np.sin(2.0 * time), np.full(5000, np.nan)])
    record = Record("made here", 0.002, 2.0 * np.cos(3.0 * time), measured, np.zeros(5000), (1e-4, 1e-4))
    return recording_scales(MODEL, [record])


def rippled(torque: float, amplitude: float) -> Effect:
    own = {"torque": torque, "amplitude": amplitude, "order": 8.0, "phase": 0.4}
    return Effect("position_dependent_friction", "j_motor", own)


@pytest.mark.parametrize(
    ("amplitude", "drives"), [(0.1, False), (0.2, False), (0.23, False), (0.5, True), (1.4, True)]
)
def test_friction_that_varies_by_more_than_itself_drives(scales, amplitude, drives):
    assert friction_drives(rippled(0.2, amplitude), scales) == drives
    assert material(rippled(0.2, amplitude), scales) != drives


@pytest.mark.parametrize(
    "effect",
    [
        Effect("coulomb_friction", "j_motor", {"torque": 0.3}),
        Effect("stribeck_friction", "j_motor", {"coulomb": 0.2, "breakaway": 0.5, "velocity": 0.1}),
        Effect("asymmetric_friction", "j_motor", {"positive": 0.1, "negative": 0.5}),
        Effect("quadratic_drag", "j_motor", {"coefficient": 0.1}),
        Effect("gravity", "j_motor", {"torque": 3.0}),
    ],
)
def test_what_opposes_all_motion_does_not_drive_and_gravity_is_no_friction(scales, effect):
    assert not friction_drives(effect, scales)
