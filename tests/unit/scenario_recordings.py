"""Recordings of scenario 1 made from formulas, so that every figure in them is known without any
simulation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from haptic_teleop_control.recording import JointStateSeries, Recording

START = 1_700_000_000_000_000_000
STIFFNESS = {"stage1": 3.971, "stage2": 3.891}
CONSTANT = {"stage1": 8.925, "stage2": 1.392}
PARAMETERS = {
    "/force_controller": {
        "stage1.lambda": 0.5,
        "stage2.lambda": 0.5,
        "omni_y.torque_gain": 10.0,
        "omni_z.torque_gain": 10.0,
        "command_source": "reference",
    },
    "/sfj/sfj_sim": {"stage1.wall.angle": 1.0, "stage2.wall.angle": 1.0},
}


@dataclass(frozen=True)
class Made:
    """What is put into a recording. Times in s; `amplitude` rad of the reference; `droop`: share lacking in
    the free speed; contact torque: second order with `damping` and `frequency` (rad/s), towards Td +
    `offset`; `lost`, `unanswered`: indices of states; `latency`: s from a state's stamp to its command's
    arrival."""

    amplitude: float = 0.06
    onset: float = 1.0
    release: float = 9.0
    duration: float = 10.0
    droop: float = 0.05
    damping: float = 0.4
    frequency: float = 8.0
    offset: float = 0.0
    bounces: int = 0
    lost: tuple[int, ...] = ()
    unanswered: tuple[int, ...] = ()
    latency: float = 0.0007
    state_delay: float = 0.0002
    contact: bool = True

    @property
    def torque(self) -> float:
        return 10.0 * self.amplitude

    @property
    def speed(self) -> float:
        return self.torque / 0.5 * (1.0 - self.droop)

    @property
    def touch(self) -> float:
        """When the arm reaches 1 rad: speed rises with a time constant of 50 ms, which delays the arrival by
        just that.
        """
        return self.onset + 1.0 / self.speed + 0.05

    @property
    def overshoot(self) -> float:
        """Percent, of a second-order step response."""
        return 100.0 * math.exp(-math.pi * self.damping / math.sqrt(1.0 - self.damping**2))


def stage_signals(made: Made, time: np.ndarray, stage: str) -> tuple[np.ndarray, ...]:
    """Return motor position, arm position, motor velocity, Te, current and reference, (n,)."""
    reference = np.where((time >= made.onset) & (time < made.release), made.amplitude, 0.0)
    moving = np.clip(time - made.onset, 0.0, (made.touch if made.contact else made.release) - made.onset)
    arm = made.speed * (moving - 0.05 * (1.0 - np.exp(-moving / 0.05)))
    velocity = np.gradient(arm, time)
    torque = np.zeros_like(time)
    if made.contact:
        pressed = np.clip(time - made.touch, 0.0, None)
        w, z = made.frequency, made.damping
        damped = w * math.sqrt(1.0 - z**2)
        swing = np.exp(-z * w * pressed) * (
            np.cos(damped * pressed) + z / math.sqrt(1 - z**2) * np.sin(damped * pressed)
        )
        torque = (made.torque + made.offset) * (1.0 - swing) * (pressed > 0)
        fading = time >= made.release
        torque[fading] *= np.exp(-(time[fading] - made.release) / 0.05)
    pressed = time - made.touch
    for bounce in range(made.bounces if made.contact else 0):
        # The arm leaves the wall by 20 mrad for 60 ms: half a sine.
        since = pressed - 0.5 - 0.2 * bounce
        arm = arm - np.where((since > 0) & (since < 0.06), 0.02 * np.sin(np.pi * since / 0.06), 0.0)
    motor = arm + torque / STIFFNESS[stage]
    return motor, arm, velocity, torque, torque / CONSTANT[stage] + 0.01, reference


def scenario(made: Made, rate: float = 500.0, parameters: dict | None = None) -> Recording:
    """Return the recording: states at `rate`, their answers, a reference at 1 kHz; both stages do the
    same.
    """
    n = round(made.duration * rate)
    time = np.arange(n) / rate
    stamps = START + np.rint(time * 1e9).astype(np.int64)
    first, second = stage_signals(made, time, "stage1"), stage_signals(made, time, "stage2")
    still = np.zeros(n)
    keep = np.setdiff1d(np.arange(n), made.lost)
    answer = np.setdiff1d(keep, made.unanswered)
    states = JointStateSeries(
        stamps[keep],
        stamps[keep] + round(made.state_delay * 1e9),
        ("stage1_motor", "stage1_arm", "stage2_motor", "stage2_arm"),
        position=np.column_stack([first[0], first[1], second[0], second[1]])[keep],
        velocity=np.column_stack([first[2], first[2], second[2], second[2]])[keep],
        effort=np.column_stack(
            [CONSTANT["stage1"] * first[4], first[3], CONSTANT["stage2"] * second[4], second[3]]
        )[keep],
    )
    commands = JointStateSeries(
        stamps[answer],
        stamps[answer] + round(made.latency * 1e9),
        ("stage1_motor", "stage2_motor"),
        effort=np.column_stack([CONSTANT["stage1"] * first[4], CONSTANT["stage2"] * second[4]])[answer],
    )
    fine = np.arange(2 * n) / (2 * rate)
    wanted = stage_signals(made, fine, "stage1")[5]
    fine_stamps = START + np.rint(fine * 1e9).astype(np.int64)
    reference = JointStateSeries(
        fine_stamps, fine_stamps + 100_000, ("omni_y", "omni_z"), position=np.column_stack([wanted, wanted])
    )
    omni = JointStateSeries(
        stamps,
        stamps + 100_000,
        ("omni_x", "omni_y", "omni_z"),
        position=np.column_stack([still, still, still]),
        velocity=np.zeros((n, 3)),
        effort=np.zeros((n, 3)),
    )
    topics = {
        "/sfj/joint_states": states,
        "/sfj/effort_command": commands,
        "/reference": reference,
        "/omni/joint_states": omni,
    }
    return Recording(
        Path("made"),
        topics,
        PARAMETERS if parameters is None else parameters,
        experiment={"kind": "scenario1"},
    )
