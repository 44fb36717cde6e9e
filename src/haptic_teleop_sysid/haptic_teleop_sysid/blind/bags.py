"""Writes a case as the lab would have it: two recordings and the model that the lab believes in."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from haptic_teleop_control.recording import JointStateSeries, write_recording
from haptic_teleop_control.robots import (
    SFJ_JOINTS,
    SFJ_MOTOR_JOINTS,
    SFJ_STAGES,
    VELOCITY_FILTER_CUTOFF_HZ,
    VELOCITY_FILTER_DAMPING,
)
from haptic_teleop_sysid.blind.cases import Case
from haptic_teleop_sysid.blind.floor import floor_percent
from haptic_teleop_sysid.blind.planting import Run, Setting, run
from haptic_teleop_sysid.blind.robot import PERIOD

Array = NDArray[np.float64]
START = 1_760_000_000_000_000_000
PARTS = ("estimation", "validation")


def velocity(position: Array) -> Array:
    """Return the velocity that the driver would publish: its second-order filter, for straight lines between
    samples.
    """
    w = 2 * math.pi * VELOCITY_FILTER_CUTOFF_HZ
    system = ([w * w, 0.0], [1.0, 2 * VELOCITY_FILTER_DAMPING * w, w * w])
    found: Any = cont2discrete(system, PERIOD, method="foh")
    return np.asarray(lfilter(np.ravel(found[0]), found[1], position - position[0]))


def record(case: Case, which: int) -> tuple[dict[str, JointStateSeries], dict[str, Any]]:
    """Return the topics of recording `which` (0, 1) and the fit (%) that the truth would reach."""
    rng = np.random.default_rng((case.seed, which))
    setting, push = case.settings[which], case.pushes[which]
    own = run(setting, list(case.planted), case.scenes["motor"], push)
    other_setting, other_push = case.others[which]
    runs: dict[str, tuple[Setting, Run, float]] = {
        setting.robot.stage: (setting, own, case.sense_offset),
        other_setting.robot.stage: (other_setting, run(other_setting, [], None, other_push), 0.0),
    }
    n = setting.samples
    position, speed, effort = (np.zeros((n, len(SFJ_JOINTS))) for _ in range(3))
    command = np.zeros((n, len(SFJ_MOTOR_JOINTS)))
    for stage, (where, moved, offset) in runs.items():
        number = SFJ_MOTOR_JOINTS.index(f"{stage}_motor")
        motor, arm = 2 * number, 2 * number + 1
        nominal = SFJ_STAGES[stage].torque_constant
        position[:, motor], position[:, arm] = moved.motor_read, moved.arm_read
        speed[:, motor], speed[:, arm] = velocity(moved.motor_read), velocity(moved.arm_read)
        sense = where.robot.sense_noise * rng.standard_normal(n) + offset
        # A sample reports the current that acted until it was taken.
        effort[:, motor] = nominal * (np.concatenate([[0.0], moved.sensed[:-1]]) + sense)
        stiffness = where.robot.truth["stiffness"]
        effort[:, arm] = stiffness * (moved.motor_read - moved.arm_read)
        command[:, number] = nominal * moved.out[:, 8]
    stamp = START + which * 10**11 + np.arange(n, dtype=np.int64) * round(PERIOD * 1e9)
    late = rng.gamma(4.0, 5e4, size=(2, n)).astype(np.int64)
    topics = {
        "/sfj/joint_states": JointStateSeries(stamp, stamp + late[0], SFJ_JOINTS, position, speed, effort),
        "/sfj/effort_command": JointStateSeries(
            stamp, stamp + late[0] + late[1], SFJ_MOTOR_JOINTS, effort=command
        ),
    }
    first = 2 * SFJ_MOTOR_JOINTS.index(f"{setting.robot.stage}_motor")
    measured = {
        f"{setting.robot.stage}_motor.velocity": speed[:, first],
        f"{setting.robot.stage}_arm.velocity": speed[:, first + 1],
    }
    return topics, floor_percent(setting, push, measured, velocity, rng)


def write_case(case: Case, directory: Path) -> dict[str, Any]:
    """Write `directory`/{estimation, validation, model.yaml}; return the label, completed by the floors."""
    label = dict(case.label)
    label["floor"] = {}
    for which, part in enumerate(PARTS):
        topics, floor = record(case, which)
        experiment = {"kind": case.settings[which].experiment.kind}
        write_recording(directory / part, topics, experiment=experiment)
        label["floor"][part] = floor
    (directory / "model.yaml").write_text(yaml.safe_dump(case.model, sort_keys=False))
    return label
