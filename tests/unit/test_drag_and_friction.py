"""Quadratic drag with dry friction at one place: two names, not one law that has none."""

import pytest
from identification_plants import STAGE, off, stage_recording

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.recordings.dataset import load_dataset

DRAG = Effect("quadratic_drag", "stage1_arm", {"coefficient": 0.3})
FRICTION = Effect("coulomb_friction", "stage1_arm", {"torque": 0.01})


def test_drag_with_dry_friction_is_told_as_both():
    truth, lab = STAGE.with_effects(DRAG, FRICTION), off(STAGE, 3, 0.1)
    learn, judge = (
        [load_dataset(stage_recording(truth, seed=seed, seconds=12.0, rms=rms, band=(0.2, 4.0)), lab)]
        for seed, rms in ((1, 0.15), (2, 0.12))
    )
    _, verdict, _, _ = diagnose(lab, learn, judge)
    assert verdict.kind == "identified"
    told = {f["effect"]: f for f in verdict.findings}
    assert set(told) == {"quadratic_drag", "coulomb_friction"}
    assert {f["location"] for f in verdict.findings} == {"stage1_arm"}
    assert told["quadratic_drag"]["parameters"]["coefficient"]["value"] == pytest.approx(0.3, rel=0.15)
    assert told["coulomb_friction"]["parameters"]["torque"]["value"] == pytest.approx(0.01, rel=0.15)
