"""Robots, noise and experiments by seed: the truth, what the lab believes of it, and how it is moved."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.robots import SFJ_STAGES
from haptic_teleop_sysid.blind.physics import FORCE_LOOP, OPEN_LOOP, POSITION_LOOP

Array = NDArray[np.float64]
PERIOD = 0.002
TYPICAL = {
    "stage1": {
        "torque_constant": 8.925,
        "stiffness": 3.971,
        "motor_inertia": 0.0635,
        "motor_damping": 2.6,
        "arm_inertia": 0.17,
        "arm_damping": 0.02,
    },
    "stage2": {
        "torque_constant": 1.392,
        "stiffness": 3.891,
        "motor_inertia": 0.00704,
        "motor_damping": 0.6,
        "arm_inertia": 0.0064,
        "arm_damping": 0.005,
    },
}
"""Where the draws lie about; SI units, at the joint."""
LOOPS = {"open loop current": OPEN_LOOP, "position loop": POSITION_LOOP, "force loop": FORCE_LOOP}
SIGNALS = ("multisine", "chirp", "triangle", "steps")
_TRAVEL = 1.2


@dataclass(frozen=True)
class Robot:
    """One stage as it is, its noise and its current sense."""

    stage: str
    truth: dict[str, float]
    noise_motor: float  # N·m rms
    noise_arm: float
    colour_motor: float  # correlation time, s
    colour_arm: float
    sense_noise: float  # A rms

    def vector(self) -> Array:
        """Return the parameters in the order that the integrator reads."""
        facts = SFJ_STAGES[self.stage]
        t = self.truth
        return np.array(
            [
                t["torque_constant"],
                t["stiffness"],
                t["motor_inertia"],
                t["motor_damping"],
                t["arm_inertia"],
                t["arm_damping"],
                PERIOD,
                facts.drive_resolution,
                facts.joint_resolution,
                facts.current_limit,
            ]
        )


@dataclass(frozen=True)
class Experiment:
    """How one recording is made: `reference` (n,) in A, rad or N·m according to the loop."""

    loop: str
    signal: str
    reference: Array
    gains: Array

    @property
    def kind(self) -> str:
        """What the recording says of itself."""
        return f"{self.loop}, {self.signal}"

    def scaled(self, factor: float) -> Experiment:
        """Return the experiment with another amplitude."""
        return replace(self, reference=self.reference * factor)


def draw_robot(rng: np.random.Generator, stage: str) -> Robot:
    """Return a stage with parameters within ±30 % of the typical ones. `with_noise` sets the noise."""
    truth = {name: value * rng.uniform(0.7, 1.3) for name, value in TYPICAL[stage].items()}
    return Robot(stage, truth, 0.0, 0.0, 0.01, 0.01, rng.uniform(0.001, 0.004))


def with_noise(robot: Robot, rng: np.random.Generator, torque: float) -> Robot:
    """Return the robot with a random disturbance of 0.3 to 6 % of `torque` (rms, N·m) and a drawn colour."""
    level = torque * math.exp(rng.uniform(math.log(0.003), math.log(0.06)))
    return replace(
        robot,
        noise_motor=level,
        noise_arm=level * rng.uniform(0.02, 0.3),
        colour_motor=math.exp(rng.uniform(math.log(0.002), math.log(0.5))),
        colour_arm=math.exp(rng.uniform(math.log(0.002), math.log(0.5))),
    )


def lab_model(rng: np.random.Generator, robot: Robot, known_torque_constant: bool) -> dict[str, object]:
    """Return the model file's content: truth off by up to 25 %, the stiffness known."""
    fixed = ["stiffness", "torque_constant"] if known_torque_constant else ["stiffness"]
    believed = {
        name: round(value if name in fixed else value * rng.uniform(0.75, 1.25), 7)
        for name, value in robot.truth.items()
    }
    return {
        "haptic_teleop_model": 1,
        "robot": "sfj",
        "joint": robot.stage,
        "structure": "flexible_joint",
        "parameters": believed,
        "fixed": fixed,
        "effects": [],
    }


def disturbance(rng: np.random.Generator, robot: Robot, n: int) -> Array:
    """Return (n + 1, 2): coloured torque on motor and arm, N·m at the samples."""
    out = np.empty((n + 1, 2))
    for column, (level, colour) in enumerate(
        ((robot.noise_motor, robot.colour_motor), (robot.noise_arm, robot.colour_arm))
    ):
        out[:, column] = level * coloured(rng.standard_normal(n + 1), math.exp(-PERIOD / colour))
    return out


def coloured(white: Array, memory: float) -> Array:
    """Return unit-variance noise in which a sample keeps `memory` of the one before."""
    from scipy.signal import lfilter

    start = white[0]
    drive = math.sqrt(1.0 - memory**2) * white
    drive[0] = start
    return np.asarray(lfilter([1.0], [1.0, -memory], drive))


def draw_experiment(
    rng: np.random.Generator, robot: Robot, loop: str, duration: float, slow: bool = False, size: float = 1.0
) -> Experiment:
    """Return an experiment in `loop`; `slow` keeps it to low frequencies, `size` scales its amplitude."""
    t = np.arange(round(duration / PERIOD), dtype=np.float64) * PERIOD
    signal = str(rng.choice(SIGNALS))
    quick = robot.stage == "stage2"
    top = rng.uniform(5.0, 12.0) if quick else rng.uniform(3.0, 7.0)
    if loop != "open loop current":
        top *= 0.4
    if slow:
        top = rng.uniform(0.5, 0.9)
    shape = _shape(rng, signal, t, top)
    truth = robot.truth
    if loop == "open loop current":
        amplitude = rng.uniform(0.15, 0.45) if signal != "triangle" else rng.uniform(0.12, 0.3)
        gains = np.zeros(8)
    elif loop == "position loop":
        amplitude = rng.uniform(0.15, 0.5)
        speed = rng.uniform(8.0, 16.0)
        gains = np.zeros(8)
        gains[0] = speed * truth["motor_damping"] / truth["torque_constant"]
        gains[1] = rng.uniform(0.0, 0.1) * truth["motor_damping"] / truth["torque_constant"]
        gains[5] = 0.25
    else:
        amplitude = rng.uniform(0.3, 0.9)
        gains = np.zeros(8)
        gains[0] = rng.uniform(1.0, 2.5) * truth["motor_damping"] / truth["torque_constant"] / 0.5
        gains[2] = rng.uniform(1.0, 5.0)
        gains[3] = rng.uniform(0.4, 0.7)
        gains[4] = rng.uniform(0.5, 1.5)
        gains[5] = 0.25
        gains[6] = truth["stiffness"]
    return Experiment(loop, signal, size * amplitude * shape, gains)


def keep_in_range(experiment: Experiment, travel: float) -> Experiment:
    """Return the experiment made smaller where `travel` (rad, largest angle reached) is beyond the range."""
    return experiment.scaled(0.98 * _TRAVEL / travel) if travel > _TRAVEL else experiment


def _shape(rng: np.random.Generator, signal: str, t: Array, top: float) -> Array:
    """Return a signal with peak 1 that begins at zero."""
    length = t[-1] + PERIOD
    if signal == "multisine":
        harmonics = np.arange(2, max(6, int(top * length)))
        chosen = harmonics[rng.random(len(harmonics)) < 0.5]
        chosen = harmonics if len(chosen) < 4 else chosen
        weights = 1.0 / (1.0 + chosen / (0.3 * top * length))
        phases = rng.uniform(0, 2 * math.pi, len(chosen))
        values = np.zeros_like(t)
        for harmonic, weight, phase in zip(chosen, weights, phases, strict=True):
            values += weight * np.sin(2 * math.pi * harmonic / length * t + phase)
    elif signal == "chirp":
        low = rng.uniform(0.08, 0.2)
        rate = math.log(top / low) / length
        values = np.sin(2 * math.pi * low * np.expm1(rate * t) / rate + rng.uniform(0, 2 * math.pi))
    elif signal == "triangle":
        period = rng.uniform(2.5, 6.0)
        phase = t / period
        values = 1.0 - 4.0 * np.abs((phase + 0.25) % 1.0 - 0.5)
        if top > 1.0:
            values = values + 0.25 * np.sin(2 * math.pi * rng.uniform(0.4, 0.9) * top * t)
    else:
        values = np.zeros_like(t)
        at, sign = 0.0, 1.0
        while at < length:
            hold = rng.uniform(0.25, 1.2) * (1.0 if top > 1.0 else 3.0)
            values[(t >= at) & (t < at + hold)] = sign * rng.uniform(0.2, 1.0)
            at, sign = at + hold, -sign if rng.random() < 0.75 else sign
    values = values * np.minimum(t / 0.5, 1.0)
    return values / np.max(np.abs(values))
