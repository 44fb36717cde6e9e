"""The thesis' findings come out again on simulated plants, and an independent physics engine's parameters
too."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "studies"))
import identification_story as story
from identification_plants import multisine

from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sysid.dataset import load_dataset
from haptic_teleop_sysid.estimation.strategies import estimate


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
    first, damping, everything, friction = (
        np.array([one["stage1_motor.velocity"], one["stage1_arm.velocity"]]) for one in found.values()
    )
    assert np.all(first < damping)
    assert np.all(damping < everything)
    assert np.all(everything < friction)


XML = """
<mujoco>
  <option timestep="0.0001" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="motor" type="hinge" axis="0 0 1" damping="0.35" frictionloss="0.12" solreffriction="0.002
      1"/> <inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/>
      <body>
        <joint name="bend" type="hinge" axis="0 0 1" stiffness="4.0" damping="0.01"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="motor"/></actuator>
</mujoco>
"""
HINGES = {"motor_inertia": 0.02, "motor_damping": 0.35, "stiffness": 4.0, "arm_inertia": 0.05,
          "j_joint.joint_damping.coefficient": 0.01, "j_motor.coulomb_friction.torque": 0.12}  # fmt: skip


def mujoco_recording(seed, seconds=10.0, dt=0.002):
    """Two hinges with a spring between, stepped 20 times a sample by MuJoCo; angles behind 1e-5 rad
    encoders."""
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed: pip install mujoco")
    engine = mujoco.MjModel.from_xml_string(XML)
    state = mujoco.MjData(engine)
    n = round(seconds / dt)
    torque = multisine(n, dt, 0.35, (0.1, 8.0), seed)
    angles = np.empty((n, 2))
    for i in range(n):
        angles[i] = state.qpos[0], state.qpos[0] + state.qpos[1]
        state.ctrl[0] = torque[i]
        for _ in range(round(dt / engine.opt.timestep)):
            mujoco.mj_step(engine, state)
    angles = 1e-5 * np.round(angles / 1e-5)
    stamps = 1_000_000_000 + np.rint(1e9 * dt * np.arange(n)).astype(np.int64)
    effort = np.column_stack([torque, np.zeros(n)])
    series = JointStateSeries(stamps, stamps, ("j", "a"), angles, None, effort)
    return Recording(Path("mujoco"), {"/plant/joint_states": series}, {}, experiment={"kind": "open loop"})


def test_the_parameters_of_an_independent_physics_engine_are_found():
    topic = "/plant/joint_states"
    io = {"input": {"topic": topic, "joint": "j", "field": "effort"}, "motor": {"topic": topic, "joint": "j"},
          "arm": {"topic": topic, "joint": "a"}}  # fmt: skip
    start = Model(
        "generic", "j", "flexible_joint",
        {"torque_constant": 1.0, "stiffness": 5.2, "motor_inertia": 0.026, "motor_damping": 0.25,
         "arm_inertia": 0.035, "arm_damping": 0.0},
        fixed=("torque_constant", "arm_damping"),
        effects=(Effect("joint_damping", "j_joint", {"coefficient": 0.013}),
                 Effect("coulomb_friction", "j_motor", {"torque": 0.08, "smoothing": 0.01})),
        io=io,
    )  # fmt: skip
    found = estimate(start, [load_dataset(mujoco_recording(1), start)])
    values = found.model.parameter_values()
    errors = {name: values[name] / true - 1.0 for name, true in HINGES.items()}
    # MuJoCo's dry friction creeps where a real contact sticks, so its smoothing is estimated, too.
    assert max(abs(e) for e in errors.values()) < 0.01
