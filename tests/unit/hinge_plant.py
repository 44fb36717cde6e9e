"""Two hinges with a spring between, simulated by MuJoCo: a plant that shares no code with this project.

The outer hinge is the motor's, with viscous damping and dry friction; the inner one bends, so that the arm's
angle is the sum of both. MuJoCo must be installed.
"""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
from identification_plants import multisine

from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_sim.model import Effect, Model

XML = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body name="drive">
      <joint name="motor" type="hinge" axis="0 0 1" damping="0.35" frictionloss="0.12"
        solreffriction="0.002 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/>
      <body name="arm">
        <joint name="bend" type="hinge" axis="0 0 1" stiffness="4.0" damping="0.01"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="torque" joint="motor"/></actuator>
  <sensor><jointpos joint="motor" name="motor"/><jointpos joint="bend" name="bend"/></sensor>
</mujoco>
"""
TRUTH = {"motor_inertia": 0.02, "motor_damping": 0.35, "stiffness": 4.0, "arm_inertia": 0.05,
         "j_joint.joint_damping.coefficient": 0.01, "j_motor.coulomb_friction.torque": 0.12}  # fmt: skip
ENCODER = 1e-5
"""rad per step of either encoder."""
ENGINE_STEP = 1e-4
"""s, far finer than any recording's period."""


def hinge_model(values: dict[str, float] | None = None) -> Model:
    """The same joint in our words, at `values` by full name (the truth where they are silent). The engine's
    dry friction creeps where a real contact sticks, so that its smoothing is a parameter, too."""
    topic = "/plant/joint_states"
    io = {"input": {"topic": topic, "joint": "j", "field": "effort"}, "motor": {"topic": topic, "joint": "j"},
          "arm": {"topic": topic, "joint": "a"}}  # fmt: skip
    model = Model(
        "generic", "j", "flexible_joint",
        {"torque_constant": 1.0, "stiffness": 4.0, "motor_inertia": 0.02, "motor_damping": 0.35,
         "arm_inertia": 0.05, "arm_damping": 0.0},
        fixed=("torque_constant", "arm_damping"),
        effects=(Effect("joint_damping", "j_joint", {"coefficient": 0.01}),
                 Effect("coulomb_friction", "j_motor", {"torque": 0.12, "smoothing": 0.01})),
        io=io,
    )  # fmt: skip
    return model.with_values(values or {})


def hinge_motion(
    seed: int, seconds: float, dt: float, rms: float = 0.35, disturbance: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Torque (n,) N·m, an odd multisine, and angles of motor and arm (n, 2) rad as the encoders read them.
    `disturbance`: rms of a random torque of 0.1 s memory that nobody records, as a share of `rms`."""
    engine = mujoco.MjModel.from_xml_string(XML.format(step=ENGINE_STEP))
    state = mujoco.MjData(engine)
    n, substeps = round(seconds / dt), round(dt / ENGINE_STEP)
    torque = multisine(n, dt, rms, (0.1, 8.0), seed)
    random, memory, unknown = np.random.default_rng(seed), np.exp(-dt / 0.1), 0.0
    angles = np.empty((n, 2))
    for i in range(n):
        angles[i] = state.qpos[0], state.qpos[0] + state.qpos[1]
        unknown = memory * unknown + np.sqrt(1.0 - memory**2) * disturbance * rms * random.standard_normal()
        state.ctrl[0] = torque[i] + unknown
        mujoco.mj_step(engine, state, substeps)
    return torque, ENCODER * np.round(angles / ENCODER)


def hinge_recording(torque: np.ndarray, angles: np.ndarray, dt: float) -> Recording:
    """The recording of such a motion."""
    stamps = 1_000_000_000 + np.rint(1e9 * dt * np.arange(len(torque))).astype(np.int64)
    effort = np.column_stack([torque, np.zeros(len(torque))])
    series = JointStateSeries(stamps, stamps, ("j", "a"), angles, None, effort)
    return Recording(Path("hinges"), {"/plant/joint_states": series}, {}, experiment={"kind": "open loop"})
