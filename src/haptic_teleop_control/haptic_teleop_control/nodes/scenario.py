"""A whole experiment from one file: start its nodes, record, watch, and stop all of it in order.

    scenario:                      # not a node: what this command reads
      ros__parameters:
        nodes: [sfj_sim, omni_sim, force_controller, signal_generator]
        duration: 20.0
    sfj_sim: {...}                 # the nodes' own parameters, as ROS reads them

The control nodes share one process, or have one each (`processes`); the recorder always has its own.
None of them starts before all have compiled what they need and know each other (`arming`): time counts from
there.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.node_tables import SCENARIO, TIME_COORDINATOR
from haptic_teleop_control.nodes.base.registry import node_class
from haptic_teleop_control.nodes.launching.children import Child, stop_all
from haptic_teleop_control.nodes.launching.starter import START_INTERVAL, Starter
from haptic_teleop_control.nodes.launching.stopping import StopRequests, stop_requests
from haptic_teleop_control.nodes.launching.watch import ProgressLine, Watcher
from haptic_teleop_control.nodes.recorder import Recorder
from haptic_teleop_control.nodes.timing.time_base import SIMULATED_TIME
from haptic_teleop_control.parameter_files import (
    check_parameter_file,
    load_parameter_file,
    parameters_for,
)
from haptic_teleop_control.scenario_section import scenario_section
from haptic_teleop_control.simulated_time.runs import new_run
from haptic_teleop_control.strict_yaml import parse_value
from haptic_teleop_control.teleoperation.agreement import check_agreement, check_recorder, simulates

FIRST_STATE_LIMIT = 30.0
"""Seconds from the start until the first state; a device may have to be calibrated."""

REFUSED = 2
"""Exit status of a process that refuses what it was given."""
LOOK_INTERVAL = 0.1
COORDINATOR = f"/{TIME_COORDINATOR.node_name}"
LAST_COMMANDS = 0.3
"""Seconds that the recorder goes on after the nodes have ended, so that their zero output is in the
recording."""


@dataclass(frozen=True)
class Scenario:
    """A checked scenario file with the command line's changes. watched: the robot whose states tell how it
    goes: the slave, or the only one that there is."""

    file: Path
    nodes: tuple[str, ...]
    watched: str
    processes: bool
    duration: float
    record: str
    note: str
    simulated: bool = False
    real_time_factor: float = 1.0
    end_after_fault: float = 0.0


def load_scenario(path: str | Path, changes: dict[str, Any] | None = None) -> Scenario:
    """Reads and checks the file: every section, every key. Raises ConfigurationError naming file, key and
    remedy."""
    if changes:
        SCENARIO.check({"nodes": ["sfj_sim"], **changes}, "command line")
    sections = load_parameter_file(path)
    values = scenario_section(sections, str(path), changes)
    tables = {name: node_class(name).TABLE for name in values["nodes"]}
    own_tables = {
        table.node_name: table for table in (SCENARIO, Recorder.TABLE, TIME_COORDINATOR)
    }
    checked = check_parameter_file(path, {**own_tables, **tables})
    taking_part = {name: values for name, values in checked.items() if name not in own_tables}
    check_agreement(taking_part, str(path))
    simulated = simulates(taking_part, str(path))
    check_recorder(parameters_for(sections, Recorder.NAME, Recorder.TABLE), simulated, str(path))
    if not simulated and "real_time_factor" in (changes or {}):
        raise ConfigurationError(
            f"--real-time-factor is for simulated time, and {path} runs by the wall: leave it out, or set "
            "use_sim_time: true for all its nodes."
        )
    return Scenario(
        Path(path),
        tuple(values["nodes"]),
        _watched(values["nodes"], checked.get("force_controller", {}).get("slave")),
        values["processes"],
        values["duration"],
        values["record"],
        values["note"],
        simulated,
        values["real_time_factor"],
        values["end_after_fault"],
    )


def _watched(nodes: Sequence[str], slave: str | None) -> str:
    robots = {node_class(name).NAMESPACE for name in nodes}
    if slave in robots and slave is not None:
        return slave
    return "sfj" if "sfj" in robots else "omni"


def start_children(scenario: Scenario, run: str) -> list[Child]:
    """The control processes, one or one for each node, and after them the recorder if there is to be one; all
    wait for the start. run: id of this run."""
    ros = ["--ros-args", "--params-file", str(scenario.file)]
    nodes = list(scenario.nodes)
    if scenario.simulated:
        recorders = [Recorder.NAME] if scenario.record else []
        ros += _stated(
            TIME_COORDINATOR.node_name,
            participants=[*nodes, *recorders],
            real_time_factor=scenario.real_time_factor,
            duration=scenario.duration,
        )
        nodes.append(TIME_COORDINATOR.node_name)
    if scenario.processes:
        children = [Child(name, ros, armed=True, run=run) for name in nodes]
    else:
        children = [Child("composed", [*nodes, *ros], armed=True, run=run)]
    if scenario.record:
        given = _stated(
            Recorder.NAME,
            output=scenario.record,
            experiment=json.dumps({"kind": scenario.file.stem, "planned_duration": scenario.duration}),
            note=scenario.note,
            use_sim_time=scenario.simulated,
        )
        children.append(Child(Recorder.NAME, [*ros, *given], armed=True, run=run))
    return children


def _stated(node: str, **values: Any) -> list[str]:
    """Arguments that state parameters of a node; JSON text is YAML text."""
    return [part for key, value in values.items() for part in ("-p", f"{node}:{key}:={json.dumps(value)}")]


def run(scenario: Scenario) -> int:
    """Runs it to its end; exit status 0, or that of the first process that failed, or 1 for a fault."""
    own_id = new_run()
    children: list[Child] = []
    faults: dict[str, str] = {}
    warnings: dict[str, tuple[int, str]] = {}
    ended = False
    with stop_requests() as stop:
        try:
            children = start_children(scenario, own_id)
            faults = _watch(scenario, own_id, children, stop, warnings)
            early = _ended_early(children)
            ended = not (stop.is_set() or faults or early)
            faults |= early
        finally:
            # In order: outputs to zero, then the recording's end.
            control = [child for child in children if child.name != Recorder.NAME]
            if {COORDINATOR, TIME_COORDINATOR.node_name} & faults.keys():
                for child in control:
                    child.link.send(cut_short=True)
            # Who grants simulated time first: nobody is then missed who ends.
            statuses = stop_all([child for child in control if child.name == TIME_COORDINATOR.node_name])
            statuses |= stop_all([child for child in control if child.name not in statuses])
            for recorder in children[len(control) :]:
                if recorder.status is None and not scenario.simulated:
                    time.sleep(LAST_COMMANDS)
                if ended:
                    recorder.link.send(ended=True)
                for node, sentence in _causes(faults).items():
                    recorder.link.send(problem=f"{node}: {sentence}")
                statuses[recorder.name] = recorder.stop()
    for node, (count, sentence) in warnings.items():
        times = f", and {count - 1} more before" if count > 1 else ""
        print(f"warning from {node}: {sentence}{times}", file=sys.stderr)
    for node, sentence in _causes(faults).items():
        print(f"fault in {node}: {sentence}", file=sys.stderr)
    for name, status in statuses.items():
        if status:
            print(f"{name} ended with exit status {status}", file=sys.stderr)
    failed = [status for status in statuses.values() if status]
    if failed:
        return failed[0] if failed[0] <= REFUSED else 1  # by a signal: it did not come about
    return 1 if faults else 0


def _ended_early(children: Sequence[Child]) -> dict[str, str]:
    """Processes that have ended although nobody had asked them to -> what that means. One that has refused
    to start says so itself."""
    return {
        child.name: f"its process ended before the experiment did (exit status {child.status}), and so all "
        f"of it was ended{_remedy(child)}"
        for child in children
        if child.status is not None and child.status != REFUSED
    }


def _remedy(child: Child) -> str:
    """What a recorder that has ended leaves to do; of itself it ends in order, with 1 where there is a
    problem, and a line that says why."""
    if child.name != Recorder.NAME:
        return ""
    if child.status in (0, 1):
        return "; what it recorded is closed, and its lines above say why"
    return "; `haptic-teleop recover` saves what it has written"


def _causes(faults: dict[str, str]) -> dict[str, str]:
    """Without what follows from simulated time having been halted."""
    if COORDINATOR not in faults:
        return faults
    halted = f"{SIMULATED_TIME}:"
    return {node: text for node, text in faults.items() if node == COORDINATOR or not text.startswith(halted)}


def _watch(
    scenario: Scenario,
    run: str,
    children: Sequence[Child],
    stop: StopRequests,
    warnings: dict[str, tuple[int, str]],
) -> dict[str, str]:
    """The faults; `warnings` is filled."""
    with Watcher(scenario.watched, scenario.simulated, run) as watcher, ProgressLine() as progress:
        watcher.warnings = warnings
        starter = Starter(children, watcher.node, scenario.simulated, watcher.run_node)
        while not stop.is_set() and all(child.status is None for child in children):
            watcher.look(LOOK_INTERVAL if starter.done else START_INTERVAL)
            for child in children:
                child.relay()
            if not starter.done:
                starter.poll()
                progress.show(starter.line)
                if not starter.done:
                    continue
                if starter.missing:
                    print(f"warning: {starter.warning}", file=sys.stderr, flush=True)
                watcher.processes = starter.processes
                watcher.begin()
            progress.show(watcher.line(scenario.duration))
            over = watcher.over(scenario.duration)
            if watcher.blind and (over or (watcher.waited > FIRST_STATE_LIMIT and not watcher.paused)):
                silent = f"no state of {scenario.watched} in {watcher.waited:.0f} s"
                return {SCENARIO.node_name: f"{silent}; put its plant among the nodes"}
            if over or watcher.in_fault_for > (scenario.end_after_fault or math.inf):
                break
            if lost := watcher.lost():
                watcher.faults[COORDINATOR] = lost
                break
    if watcher.time is not None:
        print(watcher.pace, file=sys.stderr, flush=True)
    return watcher.faults


def _number(text: str) -> float:
    """As in a file, where infinity is `.inf`; the table tells which numbers may be."""
    try:
        return float(text)
    except ValueError:
        value = parse_value(text)
    if not isinstance(value, float):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def _scenario(argv: Sequence[str]) -> int:
    parser = ArgumentParser(
        prog="haptic-teleop scenario",
        description="Start the nodes of a scenario file, watch them and stop them.",
    )
    parser.add_argument(
        "file", help="parameter file with a section `scenario:`, such as config/scenario1_sim.yaml"
    )
    parser.add_argument(
        "--duration", type=float, metavar="S", help="seconds from the start; 0: until Ctrl-C"
    )
    parser.add_argument(
        "--record", metavar="DIR", help="directory of the recording, which must not exist yet"
    )
    parser.add_argument(
        "--real-time-factor", type=_number, metavar="F",
        help="with use_sim_time: simulated seconds per second, at most; 0: as fast as it goes",
    )  # fmt: skip
    parser.add_argument(
        "--end-after-fault", type=float, metavar="S", help="end S seconds after the first fault; 0: go on"
    )
    parser.add_argument("--processes", action="store_true", default=None, help="one process for each node")
    given = vars(parser.parse_args(argv))
    file = given.pop("file")
    return run(load_scenario(file, {key: value for key, value in given.items() if value is not None}))


def main(argv: list[str] | None = None) -> int:
    return run_command(_scenario, argv)
