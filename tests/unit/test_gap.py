"""A joint with a gap whose faces damp, integrated here step by step: nothing of the project takes part."""

from dataclasses import replace

import numpy as np
import pytest
from numba import njit
from stepped_machines import DT, ELASTIC, FINE, drive

from haptic_teleop_sim.model import Effect
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.recordings.dataset import DataSet

STIFFNESS, MOTOR, ARM = 20.0, (0.06, 0.3), (0.1, 0.1)
STEP = 2.5e-4
"""rad, of both encoders."""
LAB = replace(ELASTIC, fixed=("torque_constant",))


@njit
def touching(torque, width, damping):
    """Angles and rates (n, 4) of two masses; the joint carries torque only where its faces touch."""
    q, h, found = np.zeros(4), DT / FINE, np.empty((len(torque), 4))
    for k in range(len(torque)):
        found[k] = q
        for _ in range(FINE):
            apart = q[0] - q[1]
            pressed = max(apart - 0.5 * width, 0.0) + min(apart + 0.5 * width, 0.0)
            joint = STIFFNESS * pressed + damping * (q[2] - q[3]) if pressed != 0.0 else 0.0
            q[2] += h * (torque[k] - joint - MOTOR[1] * q[2]) / MOTOR[0]
            q[3] += h * (joint - ARM[1] * q[3]) / ARM[0]
            q[0] += h * q[2]
            q[1] += h * q[3]
    return found


def recorded(seed: int, width: float, damping: float) -> DataSet:
    """20 s of it, with a random torque of 1 %."""
    torque = drive(seed, 1.0)
    luck = 0.01 * np.random.default_rng(seed).standard_normal(len(torque))
    motion = touching(torque + luck, width, damping)
    read = STEP * np.round(motion[:, :2] / STEP)
    rates = np.gradient(read, DT, axis=0)
    arm = {"arm_position": read[:, 1], "arm_velocity": rates[:, 1]}
    return DataSet(
        f"gap {seed}", "generic", "j", DT, torque, "N*m", "measured", read[:, 0], rates[:, 0],
        **arm, experiment={"kind": "open loop"}, valid=np.ones(len(torque), dtype=bool),
    )  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(
    ("width", "named"), [(0.01, "backlash"), (0.8 * STEP, "backlash"), (0.0, "joint_damping")]
)
def test_the_damping_of_the_faces_goes_with_a_gap_and_is_a_finding_without_one(width, named):
    damping = 0.02
    sets = [recorded(seed, width, damping) for seed in (1, 2)]
    result, verdict, _, _ = diagnose(LAB, sets[:1], sets[1:])
    (finding,) = verdict.findings
    assert finding["effect"] == named
    (told,) = finding["parameters"].values()
    size = width if named == "backlash" else damping
    assert told["value"] == pytest.approx(size, rel=0.1, abs=3.0 * told["std"])
    faces = next(e for e in result.final.model.effects if e.effect == "joint_damping")
    # They damp only while they touch.
    assert 0.7 * damping < faces.parameters["coefficient"] < 1.15 * damping
    assert ("joint_damping" in finding["because"]) == (named == "backlash")


@pytest.mark.long
def test_damping_that_the_model_has_is_not_said_to_come_with_a_gap():
    sets = [recorded(seed, 0.01, 0.02) for seed in (1, 2)]
    damped = LAB.with_effects(Effect("joint_damping", "j_joint", {"coefficient": 0.02}))
    _, verdict, _, _ = diagnose(damped, sets[:1], sets[1:])
    (finding,) = verdict.findings
    assert finding["effect"] == "backlash" and "goes with it" not in finding["because"]
