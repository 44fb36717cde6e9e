"""A scenario without ROS or clock, as a command: deterministic by seed, into the same bags as the graph's."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import ForceLaw
from haptic_teleop_control.named_files import model_texts
from haptic_teleop_control.recording import JointStateSeries, write_recording
from haptic_teleop_control.robots import SFJ_STAGES, STAGES
from haptic_teleop_control.signals import SignalGenerator
from haptic_teleop_control.simulated_time.stamps import ORIGIN
from haptic_teleop_control.teleoperation.machine import State

from .scenario_parameters import ScenarioParameters, check_scenario, load_scenario
from .scenario_run import AT_LIMIT, ScenarioResult, simulate_scenario

__all__ = ["load_scenario", "main", "record_scenario", "run_scenario", "simulate_scenario"]

DURATION = 20.0
"""s, where neither the caller nor the file nor the signal says how long."""

STATE_TOPIC = "/force_controller/state"

OFTEN = 0.01
"""Share of the samples at the current limit from which the torque is not what was asked for."""

FIRST = 0.01
"""s that are run before the time is taken, so that compiled code is there."""


def run_scenario(
    parameters: ScenarioParameters | Mapping[str, Mapping[str, Any]] | str | Path,
    duration: float | None = None,
    seed: int | None = None,
    law: ForceLaw | None = None,
) -> dict[str, JointStateSeries]:
    """The topics of scenario 1, as a recording of the graph would hold them.

    parameters: a scenario file, or its content (node -> {dotted key: value}; what is not stated keeps its
    default).
    duration: s; default as in the file, else the signal's end, else 20 s. seed: of both robots. law: a
    ForceLaw of your own for the two stages. Raises ConfigurationError or ModelError naming file, key and
    remedy.
    """
    scenario = _scenario(parameters)
    return simulate_scenario(scenario, _duration(scenario, duration), seed, law).topics


def record_scenario(
    scenario: ScenarioParameters, path: str | Path, duration: float | None = None, seed: int | None = None
) -> ScenarioResult:
    """Run a scenario and write it as a recording at `path`, a directory that must not exist (RecordingError).

    Beside the topics it holds the states of the teleoperation on STATE_TOPIC, as the node publishes them;
    where the file states `recorder.topics`, what these name.
    """
    length = _duration(scenario, duration)
    result = simulate_scenario(scenario, length, seed)
    experiment: dict[str, Any] = {
        "kind": Path(scenario.source).stem, "note": scenario.note, "runner": "lockstep",
    }  # fmt: skip
    prefix = "fault "  # without nodes there are no diagnostics that could tell them
    faults = {name.removeprefix(prefix): n for name, n in result.counts.items() if name.startswith(prefix)}
    if faults:
        experiment["faults"] = faults
    recorded = {node: dict(values) for node, values in scenario.recorded.items()}
    if seed is not None:
        for values in recorded.values():
            if "seed" in values:
                values["seed"] = seed
    entered = [(0.0, State.OFF.value), *result.states]  # `off` is what the node begins with
    states = [(ORIGIN + round(at * 1e9), state) for at, state in entered]
    wanted = _named(scenario) or {*result.topics, STATE_TOPIC}
    topics = {topic: series for topic, series in result.topics.items() if topic in wanted}
    texts = {STATE_TOPIC: states} if STATE_TOPIC in wanted else {}
    if not topics:
        raise ConfigurationError(
            f"{scenario.source}: recorder.topics names nothing that there is: choose among "
            f"{', '.join([*result.topics, STATE_TOPIC])}"
        )
    write_recording(path, topics, recorded, experiment, models=model_texts(recorded), texts=texts)
    return result


def _scenario(
    parameters: ScenarioParameters | Mapping[str, Mapping[str, Any]] | str | Path,
) -> ScenarioParameters:
    if isinstance(parameters, ScenarioParameters):
        return parameters
    if isinstance(parameters, str | Path):
        return load_scenario(parameters)
    return check_scenario(parameters)


def _duration(scenario: ScenarioParameters, duration: float | None) -> float:
    if duration is not None:
        return duration
    if scenario.duration > 0.0:
        return scenario.duration
    signal = scenario.nodes["signal_generator"]
    stated = {k: v for k, v in signal.items() if k in ("kind", "rate") or k.startswith("stage")}
    end = SignalGenerator.from_parameters(stated, source=scenario.source).end
    return end if 0.0 < end < 86400.0 else DURATION


def not_recorded(scenario: ScenarioParameters, result: ScenarioResult) -> list[str]:
    """Topics that the file wants recorded and that are not there without nodes, or not at all, sorted. Every
    file wants diagnostics, which nobody misses here."""
    return sorted(_named(scenario) - {*result.topics, STATE_TOPIC, "/diagnostics"})


def _named(scenario: ScenarioParameters) -> set[str]:
    """Full names of `recorder.topics`."""
    return {f"/{topic.lstrip('/')}" for topic in scenario.topics}


def at_limit(scenario: ScenarioParameters, result: ScenarioResult) -> list[str]:
    """A sentence for each stage whose force law asked for more than its current limit: in how many samples,
    and whether that matters."""
    if AT_LIMIT not in result.counts:
        return []
    values, lines = scenario.nodes["force_controller"], []
    commands = result.topics["/sfj/effort_command"].effort
    for i, stage in enumerate(STAGES):
        limit = values[f"{stage}.current_limit"]
        effort = limit * SFJ_STAGES[stage].torque_constant
        count = 0 if commands is None else int(np.sum(np.abs(commands[:, i]) >= effort * (1.0 - 1e-6)))
        if count and commands is not None:
            often = count > OFTEN * len(commands)
            lines.append(
                f"{stage}: the force law was at its current limit of {limit:g} A in {count} of "
                f"{len(commands)} samples: "
                + ("ask for less torque, or raise it" if often else "so short that it hardly matters")
            )
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """The command `lockstep`."""
    return run_command(_main, argv)


def _main(argv: list[str]) -> int:
    parser = ArgumentParser(
        prog="haptic-teleop lockstep",
        description="Run a scenario file without ROS or clock, faster than real time.",
    )
    parser.add_argument("scenario", help="parameter file of the nodes, for example config/scenario1_sim.yaml")
    parser.add_argument(
        "--record", metavar="DIR", help="write a recording there; the directory must not exist"
    )
    parser.add_argument("--duration", type=float, help="s; default as in the file")
    parser.add_argument("--seed", type=int, help="of both robots; default as in the file")
    options = parser.parse_args(argv)
    if options.seed is not None and options.seed < 0:
        raise ConfigurationError(f"argument --seed is {options.seed}; give a whole number, 0 or more.")
    scenario = load_scenario(options.scenario)
    duration = _duration(scenario, options.duration)
    simulate_scenario(scenario, FIRST, options.seed)
    begun = time.perf_counter()
    if options.record:
        result = record_scenario(scenario, options.record, duration, options.seed)
    else:
        result = simulate_scenario(scenario, duration, options.seed)
    elapsed = time.perf_counter() - begun
    console = Console(stderr=True)
    total = sum(len(topic) for topic in result.topics.values())
    console.print(
        f"{duration:g} s, {total} messages in {elapsed:.2f} s: {duration / elapsed:.0f} times real time"
    )
    for name, count in result.counts.items():
        if name != AT_LIMIT:
            console.print(f"{name}: {count} samples")
    for line in at_limit(scenario, result):
        console.print(line, markup=False, soft_wrap=True)
    if result.obstacle:
        console.print(f"not coupled at the end, {result.obstacle}", markup=False, soft_wrap=True)
    if options.record:
        if missing := not_recorded(scenario, result):
            line = f"not recorded, because nodes alone publish it, or nobody: {', '.join(missing)}"
            console.print(line, markup=False, soft_wrap=True)
        print(options.record)
    return 0
