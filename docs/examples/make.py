"""Writes learn.csv and check.csv (docs/bring_your_own_robot.md): one robot that the blind benchmark's
generator draws, logged as a lab would log it. `python docs/examples/make.py FOLDER` makes them again.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from haptic_teleop_control.robots import SFJ_STAGES
from haptic_teleop_sysid.blind.bags import record
from haptic_teleop_sysid.blind.cases import Case, draw_case
from haptic_teleop_sysid.blind.robot import PERIOD

#: The case: a second stage with play in its joint, and 9 of its 24 s.
SEED, KIND, INDEX, SECONDS = 1, "single", 163, 9.0
FILES = ("learn.csv", "check.csv")
HEADER = "time [s],torque 2 [Nm],motor angle 2 [deg],arm angle 2 [deg]"


def drawn() -> Case:
    """Return the case; its ``label`` holds what is hidden."""
    return draw_case(SEED, KIND, INDEX, "example")


def write(case: Case, folder: Path) -> None:
    """Write both logs of a case, each row with the torque that acts from it to the next."""
    for which, (name, setting) in enumerate(zip(FILES, case.settings, strict=True)):
        topics, _ = record(case, which)
        stage, rows = setting.robot.stage, round(SECONDS / PERIOD)
        states, command = topics["/sfj/joint_states"], topics["/sfj/effort_command"]
        current = command.signal(f"{stage}_motor", "effort") / SFJ_STAGES[stage].torque_constant
        angles = [states.signal(f"{stage}_{part}", "position") for part in ("motor", "arm")]
        columns = (setting.robot.truth["torque_constant"] * current, *map(np.degrees, angles))
        table = np.column_stack([PERIOD * np.arange(rows), *(c[:rows] for c in columns)])
        np.savetxt(folder / name, table, ("%.3f", "%.5f", "%.4f", "%.4f"), ",", header=HEADER, comments="")


if __name__ == "__main__":
    case = drawn()
    write(case, Path(sys.argv[1]))
    print(case.label["truth"], case.label["truth_parameters"])
