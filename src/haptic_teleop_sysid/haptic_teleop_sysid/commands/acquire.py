"""`haptic-teleop acquire`: run an identification experiment from one file, into a bag that describes itself.

    haptic-teleop acquire --config config/acquire_sfj_stage1.yaml --output recordings/stage1 [--allow]
    [--lockstep]

The file is a scenario file: a plant or a driver, and the node `acquisition`. With --lockstep the simulated
plant of the file runs without ROS or clock, faster than real time, and the same object answers its states.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from haptic_teleop_control.acquisition import ABORTED, TABLE, Acquisition
from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import NODE_PARAMETERS, SCENARIO, without_node_parameters
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.recording import JointStateSeries, write_recording
from haptic_teleop_control.strict_yaml import dump_yaml, parse_yaml
from haptic_teleop_sim.experiments import SteppedRobot, run_closed_loop
from haptic_teleop_sim.hardware import OMNI_PARAMETERS, SFJ_PARAMETERS, OmniRobot, SfjRobot
from haptic_teleop_sim.mujoco_robot import MujocoRobot
from haptic_teleop_sysid.commands.demo import run_scenario
from haptic_teleop_sysid.report.terminal import say

AFTERWARDS = 0.5
"""s of recording after the signal's end."""
AFTER_ABORT = 1.0
"""s of recording after an abort or a fault: the answers are zero from then on, so only how the robot comes to
rest is worth seeing."""
PLANTS = {"sfj_sim": SfjRobot, "mujoco_sim": MujocoRobot, "omni_sim": OmniRobot}
"""Robots that run without ROS or clock, by the node that they are in a graph."""
START_SECONDS = 1.0
"""s that the graph may take until the experiment's first state, on top."""


def experiment_from(path: str | Path, allow: bool = False) -> tuple[Acquisition, dict[str, dict[str, Any]]]:
    """The experiment of a file, and all its sections. Raises ConfigurationError naming file, key and
    remedy."""
    sections = load_parameter_file(path)
    if not any(name.rstrip("/").rsplit("/", 1)[-1] == "acquisition" for name in sections):
        raise ConfigurationError(f"{path} has no section acquisition: add one, it says what to identify.")
    own = without_node_parameters(parameters_for(sections, "acquisition", TABLE))
    if allow:
        own["allow"] = True
    return Acquisition(TABLE.check(own, str(path)), str(path)), sections


def run_lockstep(
    experiment: Acquisition,
    sections: Mapping[str, Mapping[str, Any]],
    folder: Path | None = None,
    source: str = "parameters",
    node: str = "",
) -> tuple[dict[str, JointStateSeries], dict[str, dict[str, Any]]]:
    """The topics that a recording of the graph would hold, until shortly after the signal's end or an
    abort, and the parameters. node: the plant's, `sfj_sim` or `omni_sim` where it is empty."""
    node = node or f"{experiment.robot}_sim"
    table = SFJ_PARAMETERS if experiment.robot == "sfj" else OMNI_PARAMETERS
    whole = ParameterTable(node, [*table, *NODE_PARAMETERS])
    values = whole.check(parameters_for(sections, node, whole), source)
    own = without_node_parameters(values)
    robot: SteppedRobot = PLANTS[node].from_parameters(own, folder=folder, source=source)
    experiment.reset()
    signal: list[float] = []

    def answer(time: float, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray) -> np.ndarray:
        told = round(time * 1e9) * 1e-9  # the node knows its time from stamps, which are whole nanoseconds
        command = experiment.step(told, position, velocity).copy()
        signal.append(experiment.published)
        return command

    aborted: list[float] = []

    def over(time: float) -> bool:
        if experiment.phase == ABORTED and not aborted:
            aborted.append(time)
        return bool(aborted) and time - aborted[0] >= AFTER_ABORT

    topics = run_closed_loop(robot, answer, experiment.end + AFTERWARDS, over)
    states = topics[f"/{experiment.robot}/joint_states"]
    column = np.array(signal)[:, None]
    position, effort = (column, None) if experiment.closed else (None, column)
    topics["/reference"] = JointStateSeries(
        states.stamp, states.received, (experiment.driven,), position, None, effort
    )
    recorded = {"/acquisition": experiment.values, f"/{experiment.robot}/{node}": values}
    return topics, recorded


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status: 1 when the experiment was aborted."""
    arguments = _parser().parse_args(argv)
    path = Path(arguments.config)
    experiment, sections = experiment_from(path, arguments.allow)
    screen = Console(stderr=True)
    for warning in experiment.warnings:
        say(screen, f"warning: {warning}")
    stated = parameters_for(sections, "scenario", SCENARIO)
    scenario = SCENARIO.check({"nodes": ["acquisition"], **stated}, str(path))
    output = Path(arguments.output)
    if output.exists():
        raise ConfigurationError(f"{output} exists already: choose another --output for the recording.")
    if not arguments.lockstep:
        return _graph(path, experiment, sections, output)
    with screen.status("simulating"):
        node = "mujoco_sim" if "mujoco_sim" in scenario["nodes"] else ""
        topics, recorded = run_lockstep(experiment, sections, path.parent, str(path), node)
        described = {"kind": experiment.kind, "note": scenario["note"], "runner": "lockstep"}
        write_recording(output, topics, recorded, described)
    if experiment.phase == ABORTED:
        screen.print(f"aborted: {experiment.sentence}", markup=False, highlight=False)
    print(output)
    return 1 if experiment.phase == ABORTED else 0


def _graph(
    path: Path, experiment: Acquisition, sections: Mapping[str, Mapping[str, Any]], output: Path
) -> int:
    """Run the file's nodes; an --allow on the command line reaches them in a changed copy beside the file."""
    duration = experiment.end + AFTERWARDS
    if not parameters_for(sections, "acquisition").get("use_sim_time", False):
        duration += START_SECONDS
    content = parse_yaml(path.read_text(encoding="utf-8"))
    stated = [section for section in content if section.rstrip("/").rsplit("/", 1)[-1] == "acquisition"]
    if all(content[s]["ros__parameters"].get("allow", False) == experiment.values["allow"] for s in stated):
        return run_scenario(path, output, duration, after_fault=AFTER_ABORT)
    for section in stated:
        content[section]["ros__parameters"]["allow"] = experiment.values["allow"]
    # In the same folder, so that model files that it names are still found.
    with tempfile.NamedTemporaryFile("w", dir=path.parent, prefix=f"{path.stem}-", suffix=".yaml") as copy:
        copy.write(dump_yaml(content))
        copy.flush()
        return run_scenario(Path(copy.name), output, duration, after_fault=AFTER_ABORT)


def main(argv: list[str] | None = None) -> int:
    """Entry point: 0 done, 1 aborted by a limit or a fault, 2 for bad arguments or files."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop acquire", description="Run an identification experiment, into a bag."
    )
    parser.add_argument(
        "--config", required=True, metavar="FILE", help="such as config/acquire_sfj_stage1.yaml"
    )
    parser.add_argument(
        "--output", required=True, metavar="DIR", help="the recording, which must not exist yet"
    )
    parser.add_argument("--allow", action="store_true", help="permit currents above the recommended 0.5 A")
    parser.add_argument(
        "--lockstep", action="store_true", help="simulate the file's plant without ROS or clock"
    )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
