"""Plants and experiments of the identification study and of the tests: the 2DSFJ stage of equation (10)
with six parameters, the Omni axis of equation (23) with nine, each simulated in lockstep behind its
hardware."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from plants import FLEXIBLE

from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.experiments import run_closed_loop, run_open_loop
from haptic_teleop_sim.hardware import OmniRobot, SfjRobot
from haptic_teleop_sim.model import Effect, Model
from haptic_teleop_sim.omni_robot import OmniSettings, axis_hardware
from haptic_teleop_sim.sfj_robot import SfjSettings, stage_hardware

STAGE = Model(
    "sfj",
    "stage1",
    "flexible_joint",
    FLEXIBLE,
    fixed=("stiffness",),
)
AXIS = Model(
    "omni",
    "omni_y",
    "flexible_joint",
    {
        "torque_constant": 1.0,
        "stiffness": 3.0,
        "motor_inertia": 0.0015,
        "motor_damping": 0.002,
        "arm_inertia": 0.001,
        "arm_damping": 0.0,
    },
    fixed=("torque_constant", "arm_damping"),
    effects=(
        Effect("joint_damping", "omni_y_joint", {"coefficient": 0.004}),
        Effect(
            "stribeck_friction",
            "omni_y_motor",
            {"coulomb": 0.02, "breakaway": 0.03, "velocity": 0.2, "smoothing": 0.02},
        ),
    ),
)
CLOSED_TORQUE = 3.1
"""N·m, rms of the motor torque in `stage_recording`'s position loop, measured without disturbance."""
_PERFECT = {
    "command_resolution": 0.0,
    "drive_resolution": 0.0,
    "joint_resolution": 0.0,
    "sense_offset": 0.0,
    "sense_noise": 0.0,
    "sense_resolution": 0.0,
}


def multisine(n: int, dt: float, rms: float, band: tuple[float, float], seed: int, period: float = 20.0):
    """(n,) sines of equal amplitude and random phase at odd multiples of 1/period within a band in Hz."""
    rng = np.random.default_rng(seed)
    time = dt * np.arange(n)
    total = np.zeros(n)
    harmonics = range(round(band[0] * period) | 1, round(band[1] * period), 2)
    for k in harmonics:
        total += np.sin(2.0 * np.pi * k / period * time + rng.uniform(0.0, 2.0 * np.pi))
    return rms * np.sqrt(2.0 / len(harmonics)) * total


def stage_recording(
    truth: Model = STAGE,
    seed: int = 1,
    seconds: float = 24.0,
    closed: bool = False,
    perfect: bool = False,
    disturbance: float = 0.01,
    rms: float = 0.12,
    band: tuple[float, float] = (0.2, 12.0),
) -> Recording:
    """Stage 1 at 500 Hz: open loop in current, or a position loop. `disturbance`: rms as a share of the motor
    torque; `perfect`: no quantisation and no noise whatever."""
    n, dt = round(seconds * 500), 0.002
    constant = truth.parameters["torque_constant"]
    torque = CLOSED_TORQUE if closed else constant * rms
    changes = _PERFECT if perfect else {"disturbance_rms": disturbance * torque}
    hardware = stage_hardware("stage1", truth, **changes)
    robot = SfjRobot(SfjSettings(stage1=hardware), dt, seed)
    nominal = robot.torque_constants[0]
    if closed:
        target = multisine(n, dt, 0.15, (0.1, 3.0), seed)

        def loop(t, position, velocity, effort):
            current = 3.0 * (target[min(round(t / dt), n - 1)] - position[0])
            return np.array([nominal * np.clip(current, -0.9, 0.9), 0.0])

        topics = run_closed_loop(robot, loop, seconds)
    else:
        current = multisine(n, dt, rms, band, seed)
        topics = run_open_loop(robot, np.column_stack([nominal * current, np.zeros(n)]))
    kind = "position loop, multisine" if closed else "open loop, multisine"
    return Recording(Path(f"stage1 seed {seed}"), topics, {}, experiment={"kind": kind})


def axis_recording(
    truth: Model = AXIS,
    seed: int = 1,
    seconds: float = 24.0,
    perfect: bool = False,
    disturbance: float = 0.01,
    rms: float = 0.2,
    band: tuple[float, float] = (0.1, 2.5),
) -> Recording:
    """Y axis of the Omni at 1 kHz in the thesis' closed loop: torque = 1 N·m/rad x (reference - angle)."""
    n, dt = round(seconds * 1000), 0.001
    target = multisine(n, dt, rms, band, seed)
    # The torque's rms is 0.62 to 0.65 N·m/rad times the reference's.
    changes = {"drive_resolution": 0.0} if perfect else {"disturbance_rms": disturbance * 0.65 * rms}
    robot = OmniRobot(OmniSettings(omni_y=axis_hardware("omni_y", truth, **changes)), dt, seed)

    def loop(t, position, velocity, effort):
        torque = target[min(round(t / dt), n - 1)] - position[1]
        return np.array([0.0, np.clip(torque, -0.44, 0.44), 0.0])

    topics = run_closed_loop(robot, loop, seconds)
    return Recording(Path(f"omni_y seed {seed}"), topics, {}, experiment={"kind": "position loop, gain 1"})


def off(truth: Model, seed: int, share: float = 0.3) -> Model:
    """A start: every free parameter too high or too low by `share`, the signs drawn by `seed`."""
    signs = np.random.default_rng(1000 + seed).choice([-1.0, 1.0], len(truth.free_parameters()))
    values = truth.parameter_values()
    moved = {n: values[n] * (1.0 + share * s) for n, s in zip(truth.free_parameters(), signs, strict=True)}
    return truth.with_values(moved)
