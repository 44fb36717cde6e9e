"""The experiments of one discovery: their parameter files, made from the project's, and how they are run.

Two acquisitions, to estimate and to validate, in open loop with multisines of different amplitude and band,
and scenario 1, force control with contact. Each runs as nodes in simulated time, or in lockstep.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.acquisition import Acquisition
from haptic_teleop_control.node_tables import SCENARIO as SCENARIO_TABLE
from haptic_teleop_control.node_tables import without_node_parameters
from haptic_teleop_control.parameter_files import load_parameter_file, parameters_for
from haptic_teleop_control.recording import bag_problems, read_recording, write_recording
from haptic_teleop_control.robots import SFJ_RATE_HZ, STAGES
from haptic_teleop_control.strict_yaml import dump_yaml, parse_yaml
from haptic_teleop_sim.lockstep import simulate_scenario
from haptic_teleop_sim.model import Model
from haptic_teleop_sim.scenario_parameters import check_scenario
from haptic_teleop_sysid.commands import acquire
from haptic_teleop_sysid.commands.demo import run_scenario
from haptic_teleop_sysid.recordings.recorded_parameters import flattened
from haptic_teleop_sysid.recordings.time_grid import GAP_PERIODS
from haptic_teleop_sysid.shipped_files import SCENARIO, find_scenario
from haptic_teleop_sysid.verification.signals import STATE_TOPIC

Array = NDArray[np.float64]
Content = dict[str, Any]

ACQUISITIONS = {"estimation": (1.0, 1.0, 11), "validation": (0.75, 0.6, 12)}
"""Factors on amplitude and band of the two recordings, and the seed of their phases."""
SIGNALS = {"stage1": {"rms": 0.18, "f_max": 4.0}, "stage2": {"rms": 0.18, "f_max": 8.0}}
"""A and Hz: lower bands than of the project's acquisitions, so that the stages travel some tenths of a radian
as they do in scenario 1, with currents below the recommended 0.5 A."""
SCENARIO_RUN = "scenario1"
LEAD_IN = 1.0
"""s at rest before a signal."""


def acquisition_content(stage: str, which: str, seconds: float) -> Content:
    """The parameter file of an acquisition, its plant still `sfj_sim` with the built-in models.

    which: a key of ACQUISITIONS; seconds: length of the signal.
    """
    content = parse_yaml(find_scenario(f"acquire_sfj_{stage}.yaml").read_text(encoding="utf-8"))
    amplitude, band, phases = ACQUISITIONS[which]
    own = content["acquisition"]["ros__parameters"]
    sines = own["signal"]["multisine"]
    changed = {
        "rms": amplitude * SIGNALS[stage]["rms"],
        "f_max": band * SIGNALS[stage]["f_max"],
        "period": min(sines["period"], seconds),
        "seed": phases,
    }
    own["signal"] = {**own["signal"], "delay": LEAD_IN, "duration": seconds, "multisine": sines | changed}
    # `diagnose` takes a recording for open loop when its description says so.
    content["scenario"]["ros__parameters"]["note"] = f"open loop in current, multisine, {which}"
    return content


def scenario_content() -> Content:
    """The parameter file of scenario 1, its plant still `sfj_sim` with the built-in models."""
    return parse_yaml(find_scenario(SCENARIO).read_text(encoding="utf-8"))


def with_plant(
    content: Content, plant: str, models: Mapping[str, str], seed: int, disturbed: bool = True
) -> Content:
    """`content` with the node `plant` in place of `sfj_sim`, and model files by stage.

    disturbed: let the random torque act that the project's acquisitions have; otherwise none.
    """
    changed = {name: section for name, section in content.items() if name != "sfj_sim"}
    own = dict(content["sfj_sim"]["ros__parameters"])
    for stage, file in models.items():
        level = _disturbance(stage) if disturbed else {}
        own[stage] = {**own.get(stage, {}), **level, "model": file}
    changed[plant] = {"ros__parameters": {**own, "seed": seed}}
    scenario = dict(content["scenario"]["ros__parameters"])
    scenario["nodes"] = [plant if name == "sfj_sim" else name for name in scenario["nodes"]]
    return {**changed, "scenario": {"ros__parameters": scenario}}


def without_wall(content: Content, stage: str) -> Content:
    """`content` of a scenario with `sfj_sim` whose `stage` has no wall: its model has a stop there itself."""
    own = dict(content["sfj_sim"]["ros__parameters"])
    own[stage] = {key: value for key, value in own.get(stage, {}).items() if key != "wall"}
    return {**content, "sfj_sim": {"ros__parameters": own}}


def write_files(folder: Path, contents: Mapping[str, Content], models: Mapping[str, Model]) -> None:
    """Parameter files and model files, `<name>.yaml`, side by side in `folder`."""
    for name, model in models.items():
        model.save(folder / f"{name}.yaml")
    for name, content in contents.items():
        text = dump_yaml(content)
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")


def experiment(content: Content) -> Acquisition:
    """The acquisition that a parameter file's content describes."""
    return Acquisition.from_parameters(without_node_parameters(dict(flattened(content["acquisition"]))))


def planned(seconds: float) -> tuple[dict[str, Array], dict[str, dict[str, float]]]:
    """stage -> (n,) current, A, of its estimation experiment at the 2DSFJ's rate; stage -> its limits."""
    inputs, limits = {}, {}
    for stage in STAGES:
        one = experiment(acquisition_content(stage, "estimation", seconds))
        inputs[stage] = one.series(np.arange(0.0, one.end, 1.0 / SFJ_RATE_HZ))
        limits[stage] = {
            key.removeprefix("limit."): value
            for key, value in one.values.items()
            if key.startswith("limit.")
        }
    return inputs, limits


def run_acquisition(file: Path, recording: Path, lockstep: bool) -> int:
    """Run an acquisition's file into a recording; exit status as of the command `acquire`."""
    with contextlib.redirect_stdout(sys.stderr):  # what it says is progress here
        mode = ["--lockstep"] if lockstep else []
        return acquire.run(["--config", str(file), "--output", str(recording), *mode])


def run_scenario1(file: Path, plant: str, recording: Path, lockstep: bool) -> int:
    """Run the scenario's file, in which `plant` is the slave, into a recording; exit status."""
    sections = dict(load_parameter_file(file))
    stated = parameters_for(sections, "scenario", SCENARIO_TABLE)
    duration = float(stated["duration"])
    if not lockstep:
        return run_scenario(file, recording, duration)
    sections["sfj_sim"] = own = sections.pop(plant)
    scenario = check_scenario(sections, file.parent, str(file), duration, stated["note"])
    slave = None
    if plant != "sfj_sim":
        values = without_node_parameters(own)
        slave = acquire.PLANTS[plant].from_parameters(values, folder=file.parent, source=str(file))
    result = simulate_scenario(scenario, duration, slave=slave)
    recorded = {
        name.replace("sfj_sim", plant): dict(values) for name, values in scenario.recorded.items()
    }
    described = {"kind": file.stem, "note": scenario.note, "runner": "lockstep"}
    write_recording(recording, result.topics, recorded, described)
    return 0


def holes(recording: Path) -> int:
    """How many holes the recorded states have that `diagnose` would not bridge unasked."""
    states = read_recording(recording).topics[STATE_TOPIC]
    return len(bag_problems(states, STATE_TOPIC, GAP_PERIODS).gaps)


def _disturbance(stage: str) -> Content:
    """The random torque of the project's acquisition of that stage."""
    content = parse_yaml(find_scenario(f"acquire_sfj_{stage}.yaml").read_text(encoding="utf-8"))
    own = content["sfj_sim"]["ros__parameters"].get(stage, {})
    return {key: value for key, value in own.items() if key == "disturbance"}
