"""The thesis' findings come out again on simulated plants, and an independent physics engine's parameters
too."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "studies"))
import identification_story as story

from haptic_teleop_sysid.estimation.strategies import estimate
from haptic_teleop_sysid.recordings.dataset import load_dataset


@pytest.mark.long
def test_a_linear_omni_model_verifies_worse_than_the_nonlinear_one_and_worst_when_slow():
    found = story.omni(seconds=12.0)
    signal = "omni_y_motor.position"
    lost = {
        b: found["nonlinear", b][signal] - found["linear", b][signal] for b in ("whole band", "slow", "quick")
    }
    assert lost["whole band"] > 20.0
    assert lost["slow"] > lost["quick"] > 10.0
    assert found["nonlinear", "whole band"][signal] > 85.0


def test_2dsfj_initial_values_verify_worse_than_damping_only_than_all_parameters():
    found = story.stage(seconds=30.0)
    signals = list(next(iter(found.values())))
    fits = {signal: [one[signal] for one in found.values()] for signal in signals}
    fits["mean of both velocities"] = list(
        np.mean([values for signal, values in fits.items() if signal.endswith("velocity")], axis=0)
    )
    # The motor, which the arm hardly moves, has its speed as near with damping alone as with everything.
    speed = fits.pop("stage1_motor.velocity")
    for signal, values in fits.items():
        assert values == sorted(values), signal
    assert speed[0] < min(speed[1:3]) <= max(speed[1:3]) < speed[3]
    assert len(fits) == 4


def test_the_parameters_of_an_independent_physics_engine_are_found():
    pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")
    from hinge_plant import TRUTH, hinge_model, hinge_motion, hinge_recording

    factors = dict(zip(TRUTH, (1.3, 0.7, 1.3, 0.7, 1.3, 0.7), strict=True))
    start = hinge_model({name: factor * TRUTH[name] for name, factor in factors.items()})
    torque, angles = hinge_motion(seed=1, seconds=10.0, dt=0.002)
    data = load_dataset(hinge_recording(torque, angles, 0.002), start)
    # A narrower smoothing than this acts within less than a sample, and only costs time.
    found = estimate(start, [data], limits={"j_motor.coulomb_friction.smoothing": (1e-3, 1.0)})
    values = found.model.parameter_values()
    assert found.converged
    assert max(abs(values[name] / true - 1.0) for name, true in TRUTH.items()) < 0.01
