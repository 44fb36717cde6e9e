"""Writes the example data of the docs: one robot that the blind benchmark's generator draws, as a lab would
have it. `python docs/examples/make.py FOLDER` makes them again, in a new folder.

    learn.csv, check.csv            logs (bring_your_own_robot.md)
    stage2/learn, stage2/check      the same experiments as recordings of the 2DSFJ (first_hour.md)
    stage2/model.yaml               what the lab believes of stage 2
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import yaml

from haptic_teleop_control.recording.series import JointStateSeries
from haptic_teleop_control.recording.writer import RecordingWriter
from haptic_teleop_control.robots import SFJ_STAGES
from haptic_teleop_sysid.blind.bags import record
from haptic_teleop_sysid.blind.cases import Case, draw_case
from haptic_teleop_sysid.blind.effects import PLACES
from haptic_teleop_sysid.blind.robot import PERIOD
from haptic_teleop_sysid.discovery.drawing import LATER

#: The case: a second stage with play in its joint, and 9 (logs) and 5 (recordings) of its 24 s.
SEED, KIND, INDEX, SECONDS, RECORDED = 1, "single", 163, 9.0, 5.0
FILES = ("learn.csv", "check.csv")
HEADER = "time [s],torque 2 [Nm],motor angle 2 [deg],arm angle 2 [deg]"


def drawn() -> Case:
    """Return the case; its ``label`` holds what is hidden."""
    places = tuple(place for place in PLACES if place[0] not in LATER)
    return draw_case(SEED, KIND, INDEX, "example", places=places)


def write(case: Case, folder: Path) -> None:
    """Write both experiments of a case, as logs and as recordings, and the lab's model."""
    bags = folder / "stage2"
    bags.mkdir(parents=True, exist_ok=True)
    for which, (name, setting) in enumerate(zip(FILES, case.settings, strict=True)):
        topics, _ = record(case, which)
        rows = round(SECONDS / PERIOD)
        write_log(case, topics, rows, folder / name)
        about = {"kind": setting.experiment.kind, "note": "made by docs/examples/make.py"}
        short = {topic: cut(series, round(RECORDED / PERIOD)) for topic, series in topics.items()}
        with RecordingWriter(bags / Path(name).stem, experiment=about, compression="zstd") as writer:
            writer.write_series(short)
    (bags / "model.yaml").write_text(yaml.safe_dump(case.model, sort_keys=False), encoding="utf-8")


def write_log(case: Case, topics: dict[str, JointStateSeries], rows: int, path: Path) -> None:
    """Write one log, each row with the torque that acts from it to the next."""
    robot = case.settings[0].robot
    states, command = topics["/sfj/joint_states"], topics["/sfj/effort_command"]
    current = command.signal(f"{robot.stage}_motor", "effort") / SFJ_STAGES[robot.stage].torque_constant
    angles = [states.signal(f"{robot.stage}_{part}", "position") for part in ("motor", "arm")]
    columns = (robot.truth["torque_constant"] * current, *map(np.degrees, angles))
    table = np.column_stack([PERIOD * np.arange(rows), *(c[:rows] for c in columns)])
    np.savetxt(path, table, ("%.3f", "%.5f", "%.4f", "%.4f"), ",", header=HEADER, comments="")


def cut(series: JointStateSeries, rows: int) -> JointStateSeries:
    """The first rows of a series, to five digits behind the point where these are noise, which packs well."""
    short = [None if a is None else np.round(a[:rows], digits) for a, digits in (
        (series.position, 9), (series.velocity, 5), (series.effort, 5),
    )]  # fmt: skip
    return JointStateSeries(series.stamp[:rows], series.stamp[:rows], series.names, *short)


if __name__ == "__main__":
    case = drawn()
    write(case, Path(sys.argv[1]))
    print(case.label["truth"], case.label["truth_parameters"])
