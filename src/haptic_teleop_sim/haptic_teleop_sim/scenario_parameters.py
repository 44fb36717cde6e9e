"""The scenario file as the lockstep runner reads it: the same sections, keys and checks as for the nodes."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.named_files import located
from haptic_teleop_control.node_tables import (
    FORCE_CONTROLLER,
    LINK,
    NODE_PARAMETERS,
    SCENARIO,
    SIGNAL_GENERATOR,
    TIME_COORDINATOR,
)
from haptic_teleop_control.parameter_files import (
    check_parameter_file,
    load_parameter_file,
    parameters_for,
)
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.recorder_parameters import TABLE as RECORDER
from haptic_teleop_control.scenario_section import scenario_section
from haptic_teleop_control.teleoperation.agreement import ROBOTS, simulates

from .hardware import OMNI_PARAMETERS, SFJ_PARAMETERS

TABLES: dict[str, ParameterTable] = {
    "sfj_sim": ParameterTable("sfj_sim", [*SFJ_PARAMETERS, *NODE_PARAMETERS]),
    "omni_sim": ParameterTable("omni_sim", [*OMNI_PARAMETERS, *NODE_PARAMETERS]),
    "force_controller": FORCE_CONTROLLER,
    "signal_generator": SIGNAL_GENERATOR,
    "link": LINK,
}
"""Tables of the nodes that take part; the link does where `force_controller` says `link: true`."""

FULL_NAMES = {
    "sfj_sim": "/sfj/sfj_sim",
    "omni_sim": "/omni/omni_sim",
    "force_controller": "/force_controller",
    "signal_generator": "/signal_generator",
    "link": "/link",
}
"""Names under which a recording keeps the nodes' parameters."""

#: Sections that speak to programs which do not take part; `scenario` holds the duration and the note.
_OTHERS = {table.node_name: table for table in (SCENARIO, RECORDER, TIME_COORDINATOR)}


@dataclass(frozen=True)
class ScenarioParameters:
    """A checked scenario. nodes: node -> all its parameters. folder: where relative model files are looked
    for. models: path as a parameter states it -> text, of model files that need not be there.
    source: the file's name, for messages. duration: s, 0 where the file says nothing. topics: what a
    recording shall hold; empty for all that there is.
    """

    nodes: Mapping[str, Mapping[str, Any]]
    duration: float = 0.0
    note: str = ""
    folder: Path | None = None
    source: str = "parameters"
    topics: tuple[str, ...] = ()
    models: Mapping[str, str] = field(default_factory=dict)
    recorded: Mapping[str, Mapping[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        linked = self.nodes["force_controller"]["link"]
        taking_part = [node for node in self.nodes if node != "link" or linked]
        recorded = {FULL_NAMES[node]: dict(self.nodes[node]) for node in taking_part}
        object.__setattr__(self, "recorded", recorded)


def load_scenario(path: str | Path) -> ScenarioParameters:
    """Read and check a scenario file; ConfigurationError names file, key and remedy: what `scenario` refuses,
    and nodes that lockstep does not have."""
    path = Path(path)
    sections = load_parameter_file(path)
    own = scenario_section(sections, str(path))
    for name in own["nodes"]:
        if name not in TABLES:
            raise ConfigurationError(f"{path}: scenario: nodes: lockstep runs no {name}; {_hint(name)}")
    scenario = check_scenario(sections, path.parent, str(path), own["duration"], own["note"])
    check_parameter_file(path, {**_OTHERS, **{name: TABLES[name] for name in own["nodes"]}})
    missing = [name for name in _needed(scenario.nodes["force_controller"]) if name not in own["nodes"]]
    if missing:
        raise ConfigurationError(
            f"{path}: scenario: nodes: lockstep runs a whole teleoperation, and the list lacks "
            f"{', '.join(missing)}; add what it lacks, or run the file with `haptic-teleop scenario`."
        )
    # Lockstep has one time; but what the graph refuses is no scenario here either.
    simulates({node: values for node, values in scenario.nodes.items() if node in own["nodes"]}, str(path))
    return scenario


def load_plants(path: str | Path) -> ScenarioParameters:
    """What a file says of the robots and their nodes, whichever it starts: it need not be a scenario file.
    Raises ConfigurationError as `check_scenario`."""
    path = Path(path)
    return check_scenario(load_parameter_file(path), path.parent, str(path))


def check_scenario(
    sections: Mapping[str, Mapping[str, Any]],
    folder: Path | None = None,
    source: str = "parameters",
    duration: float = 0.0,
    note: str = "",
    models: Mapping[str, str] | None = None,
) -> ScenarioParameters:
    """A scenario from sections as `load_parameter_file` gives them (node name -> {dotted key: value}); what
    is not stated keeps its default, and files have absolute paths, as nodes state them. ConfigurationError
    names source, key and remedy.
    """
    for name in sections:
        last = name.rstrip("/").rsplit("/", 1)[-1]
        if "*" not in name and last not in TABLES and last not in _OTHERS:
            raise ConfigurationError(f"{source}: {name} names no node of this scenario; {_hint(last)}")
    nodes = {
        node: table.check(parameters_for(sections, node, table), source) for node, table in TABLES.items()
    }
    if not models:  # else the paths only name these texts
        nodes = {
            node: {key: located(key, value, folder or Path()) for key, value in values.items()}
            for node, values in nodes.items()
        }
    told = parameters_for(sections, "recorder", RECORDER)
    recorder = RECORDER.check(told, source)
    topics = tuple(recorder["topics"]) if "topics" in told else ()
    return ScenarioParameters(nodes, duration, note, folder, source, topics, dict(models or {}))


def _needed(control: Mapping[str, Any]) -> list[str]:
    """The nodes without which these parameters of the controller make no teleoperation."""
    needed = ["sfj_sim", "omni_sim", "force_controller"]
    needed += ["signal_generator"] if control["command_source"] == "reference" else []
    return needed + (["link"] if control["link"] else [])


def _hint(name: str) -> str:
    for robot, nodes in ROBOTS.items():
        if name in nodes:
            return f"without nodes the {robot} is simulated: describe it in {robot}_sim."
    near = difflib.get_close_matches(name, TABLES, n=1)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join((*TABLES, *_OTHERS))}."
