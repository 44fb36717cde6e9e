"""The scenario of a recording once more, in lockstep: with the parameters that the recording holds of itself,
or with plants from a scenario file where the robots were real ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from haptic_teleop_control.errors import ConfigurationError, MismatchError, ModelError
from haptic_teleop_control.laws import comes_with_the_project
from haptic_teleop_control.recording import JointStateSeries, Recording
from haptic_teleop_control.robots import STAGES
from haptic_teleop_control.teleoperation.sides import REFERENCES
from haptic_teleop_sim.lockstep import run_scenario
from haptic_teleop_sim.scenario_parameters import TABLES, ScenarioParameters, check_scenario, load_plants
from haptic_teleop_sysid.recordings.recorded_parameters import flattened
from haptic_teleop_sysid.verification.signals import MASTER_TOPIC, REFERENCE_TOPIC, STATE_TOPIC

PLANTS = ("sfj_sim", "omni_sim")
CONTROLLER, GENERATOR = "force_controller", "signal_generator"
TRUST_OPTION = "--trust-recorded-code"


class UntrustedCode(ConfigurationError):
    """A recording names code that does not come with the project, and nobody said that it is trusted."""


@dataclass(frozen=True)
class SimulatedRun:
    """recording: what the simulation gave, as a recording. command: where its command comes from.
    plants: where its plants come from."""

    recording: Recording
    command: str
    plants: str


def stated_nodes(recording: Recording, trust_code: bool = False) -> dict[str, dict[str, Any]]:
    """Node's last name -> its parameters, dotted, of the nodes of a scenario that the recording describes;
    what ROS itself adds is left out.

    Raises UntrustedCode where one names code that does not come with the project, unless `trust_code`: to
    know that code's parameters, it has to be imported, which executes it.
    """
    found: dict[str, dict[str, Any]] = {}
    for node, values in recording.parameters.items():
        name = str(node).rstrip("/").rsplit("/", 1)[-1]
        if name in TABLES and isinstance(values, Mapping):
            flat = dict(flattened(values))
            if not trust_code:
                _refuse_foreign_code(flat, name)
            table = TABLES[name].for_values(flat, str(recording.path))
            found[name] = {key: value for key, value in flat.items() if key in table}
    return found


def _refuse_foreign_code(values: Mapping[str, Any], node: str) -> None:
    for entry in TABLES[node]:
        stated = values.get(entry.name)
        named = entry.plugin and isinstance(stated, str) and ":" in stated
        if named and not comes_with_the_project(str(stated)):
            raise UntrustedCode(
                f"names {stated!r} as {entry.name} of its {node}, which does not come with this project; a "
                f"simulation would execute that code: look at it, and add {TRUST_OPTION} if you trust it"
            )


def can_be_simulated(recording: Recording, trust_code: bool = False) -> str | None:
    """None when the recording says all that a simulation needs, else what is missing, as half a sentence."""
    try:
        stated = stated_nodes(recording, trust_code)
    except UntrustedCode as refusal:
        return str(refusal)
    if CONTROLLER not in stated:
        return "does not say the parameters of its force_controller"
    missing = [plant for plant in PLANTS if plant not in stated]
    return (
        f"was not made with {' and '.join(missing)}, so nothing says what plants to simulate; a scenario "
        "file after --simulate does"
        if missing
        else None
    )


def simulate_recording(
    recording: Recording, name: str, scenario: str | None = None, trust_code: bool = False
) -> SimulatedRun:
    """The scenario of `recording` in lockstep, as long as the recording.

    scenario: a scenario file whose plants are simulated; what the recording says of the controller and the
    command is used beside them. Without one, models are taken from the recording, from their files only where
    it holds none. The command is that of the signal generator where it commanded, otherwise
    the recorded one: what the operator did with the device. trust_code: whether a force law that does not
    come with the project may be imported because the recording names it.
    Raises UntrustedCode naming such a law otherwise, MismatchError naming the recording when it does not say
    enough, ConfigurationError or ModelError for a scenario file or a model file that cannot be used.
    """
    try:
        stated = stated_nodes(recording, trust_code)
    except UntrustedCode as refusal:
        raise UntrustedCode(f"{name} {refusal}.") from refusal
    parameters = load_plants(scenario) if scenario is not None else None
    if parameters is None:
        lacking = can_be_simulated(recording, trust_code)
        if lacking is not None:
            raise MismatchError(f"{name} {lacking}.")
        nodes: dict[str, dict[str, Any]] = dict(stated)
    else:
        nodes = {node: dict(values) for node, values in parameters.nodes.items()}
        nodes |= {node: values for node, values in stated.items() if node not in PLANTS}
    nodes[CONTROLLER] = nodes[CONTROLLER] | {"auto_engage": True}
    command = _command(recording, nodes, name)
    states = recording.topic(STATE_TOPIC)
    duration = float(states.time()[-1]) + float(np.median(np.diff(states.time())))
    folder = None if parameters is None else parameters.folder
    try:
        if scenario is None:
            models = {path: text for path, text in recording.models.items() if isinstance(text, str)}
            checked = check_scenario(nodes, source="its description", models=models)
        else:
            checked = check_scenario(nodes, folder, scenario)
        topics = run_scenario(checked, duration)
    except (ConfigurationError, ModelError) as error:
        raise type(error)(f"{name} cannot be simulated here: {error}") from error
    simulated = Recording(
        path=recording.path,
        topics=topics,
        parameters={**recording.parameters, **_recorded(checked)},
        experiment={**recording.experiment, "runner": "lockstep"},
    )
    return SimulatedRun(
        simulated, command, f"the recording's {' and '.join(PLANTS)}" if scenario is None else scenario
    )


def _recorded(parameters: ScenarioParameters) -> dict[str, Any]:
    return {node: dict(values) for node, values in parameters.recorded.items()}


def _command(recording: Recording, nodes: dict[str, dict[str, Any]], name: str) -> str:
    """Puts the command into `nodes`; returns where it comes from."""
    control = TABLES[CONTROLLER].check(nodes[CONTROLLER], name)
    if control["command_source"] == "reference" and GENERATOR in nodes:
        return "the signal generator's parameters"
    held = nodes.get(f"{control['master']}_sim", {}).get("operator.mode", "none")
    if control["command_source"] == "device" and held != "none":
        return "the simulated operator's parameters"
    joints, field = REFERENCES[control["master"]]
    series, source = _commanding(recording, control, joints, field, name)
    nodes[CONTROLLER] = nodes[CONTROLLER] | {"command_source": "reference"}
    begin = int(recording.topic(STATE_TOPIC).stamp[0])
    values: dict[str, Any] = {"kind": field, "joints": list(joints)}
    for stage, joint in zip(STAGES, joints, strict=True):
        times, levels = _pieces(series, joint, field, begin)
        values |= {
            f"{stage}.enabled": True,
            f"{stage}.steps.enabled": True,
            f"{stage}.steps.times": times,
            f"{stage}.steps.levels": levels,
        }
    rate = (len(series) - 1) / max(float(series.time()[-1]), 1e-3)
    nodes[GENERATOR] = values | {"rate": float(np.clip(round(rate), 100.0, 1000.0))}
    return f"what {source} recorded"


def _commanding(
    recording: Recording, control: Mapping[str, Any], joints: tuple[str, ...], field: str, name: str
) -> tuple[JointStateSeries, str]:
    wanted = REFERENCE_TOPIC
    if control["command_source"] == "device":
        if control["master"] != "omni":
            raise MismatchError(
                f"{name} was made with hands on the 2DSFJ's arms, which no simulation can repeat: verify it "
                "with --no-simulation."
            )
        wanted = MASTER_TOPIC
    series = recording.topics.get(wanted)
    if (
        series is None
        or len(series) < 2
        or getattr(series, field) is None
        or not set(joints) <= set(series.names)
    ):
        raise MismatchError(f"{name} holds no {field} of {', '.join(joints)} on {wanted}: record it, too.")
    return series, wanted


def _pieces(series: JointStateSeries, joint: str, field: str, begin: int) -> tuple[list[float], list[float]]:
    """The signal as constant pieces, without those that change nothing: (times s, levels)."""
    values = series.signal(joint, field)
    times = np.maximum((series.stamp - begin) * 1e-9, 0.0)
    keep = np.isfinite(values)
    times, values = times[keep], values[keep]
    last = np.append(np.flatnonzero(np.diff(times) > 0.0), len(times) - 1)  # of equal times the newest
    times, values = times[last], values[last]
    changes = np.append(True, np.diff(values) != 0.0)
    return times[changes].tolist(), values[changes].tolist()
