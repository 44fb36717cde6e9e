"""Two encoders whose zeros differ are told from a weight, a slip and a gear of another scale."""

from dataclasses import replace

import numpy as np
import pytest
from identification_plants import STAGE, stage_recording

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.inputs.zeros import difference_of_zeros, with_one_zero
from haptic_teleop_sysid.recordings.dataset import load_dataset

STIFF = STAGE.parameters["stiffness"]


def recorded(truth=STAGE, seed=1):
    recording = stage_recording(truth, seconds=12.0, rms=0.3, seed=seed)
    return load_dataset(recording, STAGE, f"bag{seed}")


@pytest.mark.parametrize("shift", [0.3, -0.5])
def test_zeros_that_differ_are_made_one_and_said(shift):
    one = recorded()
    apart = replace(one, arm_position=one.arm_position - shift)
    found = with_one_zero(apart, STAGE)
    assert np.allclose(found.arm_position, one.arm_position, atol=0.02 * abs(shift))
    (said,) = set(found.problems) - set(one.problems)
    assert "different zeros" in said and ("added to" if shift > 0.0 else "taken from") in said


def test_equal_ones_are_left_alone():
    one = recorded()
    assert with_one_zero(one, STAGE) is one


@pytest.mark.parametrize(
    ("effect", "sizes"),
    [
        ("constant_torque", {"torque": 2.0}),
        ("gravity", {"torque": 3.0, "phase": 1.2}),
        ("coulomb_friction", {"torque": 0.3}),
    ],
)
@pytest.mark.parametrize("place", ["motor", "arm"])
def test_what_the_whole_joint_carries_is_no_zero(effect, sizes, place):
    truth = STAGE.with_effects(Effect(effect, f"stage1_{place}", sizes))
    assert difference_of_zeros(recorded(truth), STAGE) == 0.0


def test_an_encoder_that_slips_has_no_zero():
    one = recorded()
    late = np.arange(len(one)) > 0.6 * len(one)
    slipped = replace(one, arm_position=one.arm_position - 0.5 * late)
    assert difference_of_zeros(slipped, STAGE) == 0.0


def test_an_encoder_of_another_scale_is_no_zero():
    one = recorded()
    moved = {n: getattr(one, n) + 3.0 for n in ("motor_position", "arm_position")}
    scaled = replace(one, **moved)
    scaled = replace(scaled, arm_position=1.05 * scaled.arm_position)
    assert difference_of_zeros(scaled, STAGE) == 0.0


def test_holes_do_not_matter():
    one = recorded()
    valid = np.ones(len(one), dtype=np.bool_)
    valid[1000:1100] = False
    arm = np.where(valid, one.arm_position - 0.3, np.nan)
    holed = replace(one, arm_position=arm, valid=valid)
    assert difference_of_zeros(holed, STAGE) == pytest.approx(0.3, rel=0.05)
