"""A stage in open loop on which torques act that nobody recorded."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from identification_plants import STAGE, multisine

from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.experiments import run_open_loop
from haptic_teleop_sim.hardware import SfjRobot
from haptic_teleop_sim.sfj_robot import SfjSettings, stage_hardware
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import load_dataset

DT, SECONDS, RMS = 0.002, 20.0, 0.12
TIME = DT * np.arange(round(SECONDS / DT))
CONSTANT = 8.925


def recording(seed, added=0.0, truth=STAGE, slip=None, at_arm=0.0, driven=1.0):
    """Stage 1 in open loop; `added` and `at_arm` (n,) N·m act at its motor and arm and nobody recorded them;
    `slip`: s, when the arm's encoder slips by 0.01 rad; `driven` (n,): factor on the current."""
    hardware = stage_hardware("stage1", truth, disturbance_rms=0.01 * CONSTANT * RMS)
    robot = SfjRobot(SfjSettings(stage1=hardware), DT, seed)
    current = driven * multisine(len(TIME), DT, RMS, (0.2, 10.0), seed)
    wanted = robot.torque_constants[0] * current
    unseen = np.broadcast_to(np.asarray(added, dtype=float), len(TIME))
    outer = np.column_stack([np.broadcast_to(at_arm, len(TIME)), np.zeros(len(TIME))])
    topics = dict(run_open_loop(robot, np.column_stack([wanted + unseen, np.zeros(len(TIME))]), outer))
    command, states = topics["/sfj/effort_command"], topics["/sfj/joint_states"]
    effort, sensed, position = command.effort.copy(), states.effort.copy(), states.position.copy()
    effort[:, 0] -= unseen[: len(effort)]
    sensed[1:, 0] -= unseen[: len(sensed) - 1]
    if slip is not None:
        position[TIME[: len(position)] >= slip, 1] += 0.01
    topics["/sfj/effort_command"] = replace(command, effort=effort)
    topics["/sfj/joint_states"] = replace(states, effort=sensed, position=position)
    return Recording(Path(f"seed {seed}"), topics, {}, experiment={})


def dataset(seed, *args, **changes):
    """The same as a data set."""
    return load_dataset(recording(seed, *args, **changes), STAGE, f"seed {seed}")


def fitted(*sets):
    """A fit of the stage as it is believed to each of the data sets, as `doubted` has them."""
    kinds = [records_of([one]) for one in sets]
    fits = [fit_from_scratch(STAGE, records) for records in kinds]
    return list(zip(fits, kinds, strict=True))
