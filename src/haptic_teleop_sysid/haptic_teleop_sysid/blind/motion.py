"""A recording as the rival methods see it: smoothed angles, speeds and accelerations of one stage."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import SFJ_STAGES

Array = NDArray[np.float64]
CUTOFF_HZ = 15.0
SKIP = 5
"""Of the smoothed samples every SKIP-th is kept."""


@dataclass(frozen=True)
class Motion:
    """A recording as the methods use it, zero-phase smoothed: angles, speeds, accelerations, current (A)."""

    motor: Array
    arm: Array
    motor_speed: Array
    arm_speed: Array
    motor_acceleration: Array
    arm_acceleration: Array
    current: Array
    time: Array
    period: float
    raw: Array  # (n, 2) encoder angles


def read_motion(bag: Path, stage: str) -> Motion:
    """Return the motion of one stage."""
    states = read_recording(bag).topics["/sfj/joint_states"]
    t = states.time()
    period = float(np.median(np.diff(t)))
    raw = np.column_stack([states.signal(f"{stage}_{side}", "position") for side in ("motor", "arm")])
    effort = states.signal(f"{stage}_motor", "effort") / SFJ_STAGES[stage].torque_constant
    design: Any = butter(3, CUTOFF_HZ * 2 * period)
    smooth = filtfilt(design[0], design[1], raw, axis=0)
    speed = np.gradient(smooth, period, axis=0)
    acceleration = np.gradient(speed, period, axis=0)
    held = np.append(effort[1:], effort[-1])
    current = filtfilt(
        design[0], design[1], 0.5 * (held + effort)
    )  # mean of before and after: as at the sample
    columns = (*smooth.T, *speed.T, *acceleration.T, current, t)
    kept = [np.asarray(c, dtype=np.float64)[50:-50:SKIP] for c in columns]
    return Motion(*kept, period, raw)  # pyright: ignore[reportCallIssue]
