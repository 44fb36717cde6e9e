"""The scenario file as the lockstep runner reads it: the same sections, keys and checks as for the nodes.

The nodes build these tables beside their ROS code, where a program without ROS cannot reach them; that both
are the same is tested.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.laws import LAWS, MasterSide
from haptic_teleop_control.parameters import (
    Parameter,
    ParameterTable,
    load_parameter_file,
    parameters_for,
)
from haptic_teleop_control.robots import OMNI_RATE_HZ, PAIRS, SFJ_RATE_HZ, STAGES
from haptic_teleop_control.signals import signal_parameters

from .hardware import OMNI_PARAMETERS, SFJ_PARAMETERS

AXES = tuple(PAIRS[stage] for stage in STAGES)

REALTIME_PRIORITY = Parameter(
    "realtime_priority",
    0,
    minimum=0,
    maximum=90,
    meaning="SCHED_FIFO priority of the whole process, where the system permits it; 0 for normal scheduling",
)


def _controller() -> ParameterTable:
    robots = ("omni", "sfj")
    laws = {entry.name: entry for law in LAWS.values() for entry in law.parameters(STAGES)}
    source = "reference: the signal generator's position stands for the device's; device: manual mode"
    return ParameterTable(
        "force_controller",
        [
            Parameter("master", "omni", choices=robots, meaning="robot that the operator holds"),
            Parameter("slave", "sfj", choices=robots, meaning="robot that touches the environment"),
            Parameter("law", "augmented_error", choices=tuple(LAWS), meaning="force law of the slave"),
            Parameter("command_source", "reference", choices=("reference", "device"), meaning=source),
            Parameter("timeout", 0.05, "s", 0.005, 0.2, meaning="largest age of an input that is used"),
            Parameter(
                "ramp_time", 0.2, "s", 0.0, 5.0, meaning="from zero to full output after a start or reset"
            ),
            Parameter("slave_rate", SFJ_RATE_HZ, "Hz", 10.0, 10000.0, meaning="rate of the slave's states"),
            Parameter(
                "master_rate", OMNI_RATE_HZ, "Hz", 10.0, 10000.0, meaning="rate of the master's states"
            ),
            REALTIME_PRIORITY,
            *laws.values(),
            *MasterSide.parameters(AXES),
        ],
    )


TABLES: dict[str, ParameterTable] = {
    "sfj_sim": ParameterTable("sfj_sim", [*SFJ_PARAMETERS, REALTIME_PRIORITY]),
    "omni_sim": ParameterTable("omni_sim", [*OMNI_PARAMETERS, REALTIME_PRIORITY]),
    "force_controller": _controller(),
    "signal_generator": ParameterTable(
        "signal_generator",
        [
            Parameter(
                "joints", list(AXES), length=len(STAGES), meaning="joints that stage1 and stage2 command"
            ),
            Parameter(
                "autostart",
                True,
                meaning="start the signal with the node; otherwise with the service ~/start",
            ),
            REALTIME_PRIORITY,
            *signal_parameters(STAGES),
        ],
    ),
}
"""Tables of the nodes that take part."""

FULL_NAMES = {
    "sfj_sim": "/sfj/sfj_sim",
    "omni_sim": "/omni/omni_sim",
    "force_controller": "/force_controller",
    "signal_generator": "/signal_generator",
}
"""Names under which a recording keeps the nodes' parameters."""

#: Sections that speak to programs which do not take part; `scenario` holds the duration and the note.
_OTHERS = ("scenario", "recorder")


@dataclass(frozen=True)
class ScenarioParameters:
    """A checked scenario. nodes: node -> all its parameters. folder: where relative model files are looked
    for.
    source: the file's name, for messages. duration: s, 0 where the file says nothing.
    """

    nodes: Mapping[str, Mapping[str, Any]]
    duration: float = 0.0
    note: str = ""
    folder: Path | None = None
    source: str = "parameters"
    recorded: Mapping[str, Mapping[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        recorded = {FULL_NAMES[node]: dict(values) for node, values in self.nodes.items()}
        object.__setattr__(self, "recorded", recorded)


def load_scenario(path: str | Path) -> ScenarioParameters:
    """Read and check a scenario file; ConfigurationError names file, key and remedy."""
    path = Path(path)
    sections = load_parameter_file(path)
    others = parameters_for(sections, "scenario")
    duration = others.get("duration", 0.0)
    if isinstance(duration, bool) or not isinstance(duration, int | float) or not 0.0 <= duration <= 86400.0:
        raise ConfigurationError(f"{path}: scenario: duration is {duration!r}; write seconds, 0 to 86400.")
    return check_scenario(sections, path.parent, str(path), float(duration), str(others.get("note", "")))


def check_scenario(
    sections: Mapping[str, Mapping[str, Any]],
    folder: Path | None = None,
    source: str = "parameters",
    duration: float = 0.0,
    note: str = "",
) -> ScenarioParameters:
    """A scenario from sections as `load_parameter_file` gives them (node name -> {dotted key: value}); what
    is not stated keeps its default. ConfigurationError names source, key and remedy.
    """
    for name in sections:
        last = name.rstrip("/").rsplit("/", 1)[-1]
        if "*" not in name and last not in TABLES and last not in _OTHERS:
            near = difflib.get_close_matches(last, TABLES, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join((*TABLES, *_OTHERS))}."
            raise ConfigurationError(f"{source}: {name} names no node of this scenario; {hint}")
    wild = {name for name in sections if "*" in name}
    nodes = {}
    for node, table in TABLES.items():
        # What a wildcard says to others does not concern this node.
        common = parameters_for({name: sections[name] for name in wild}, node)
        own = parameters_for({name: sections[name] for name in sections if name not in wild}, node)
        known = {key: value for key, value in common.items() if key in table}
        nodes[node] = table.check({**known, **own}, source)
    return ScenarioParameters(nodes, duration, note, folder, source)
