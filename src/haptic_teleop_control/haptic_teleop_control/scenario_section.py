"""The section `scenario:` of a scenario file, checked without ROS: for the command `scenario` and for
lockstep."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.front_door import executables
from haptic_teleop_control.node_tables import SCENARIO
from haptic_teleop_control.parameter_files import parameters_for

SEPARATE = ("recorder",)
"""Nodes that write to disk: never in the control process."""


def node_names() -> list[str]:
    """Executables that are nodes and may share a process: those whose module lies in a `nodes`
    sub-package."""
    runners = (*SEPARATE, "composed", "scenario")
    return [
        name for name, (target, _) in executables().items() if ".nodes." in target and name not in runners
    ]


def refuse_no_node(name: str) -> None:
    """Raise ConfigurationError, with the nearest name, for an executable that is no node or shares no
    process."""
    if name in SEPARATE:
        raise ConfigurationError(
            f"{name} writes to disk and never shares the control process; start it by itself."
        )
    if name not in node_names():
        nearest = difflib.get_close_matches(name, node_names(), n=1)
        hint = f"did you mean {nearest[0]}?" if nearest else f"choose from {', '.join(node_names())}."
        raise ConfigurationError(f"{name} is not a node; {hint}")


def scenario_section(
    sections: Mapping[str, Mapping[str, Any]], source: str, changes: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return all values of the section, with the command line's `changes`; `nodes` names nodes, each once.

    Raises ConfigurationError naming `source`, key and remedy.
    """
    # What a wildcard says to the nodes is checked with them.
    own = parameters_for(sections, SCENARIO.node_name, SCENARIO)
    values = SCENARIO.check({**own, **(changes or {})}, source)
    try:
        for name in values["nodes"]:
            refuse_no_node(name)
    except ConfigurationError as error:
        raise ConfigurationError(f"{source}: scenario: nodes: {error}") from None
    if len(set(values["nodes"])) < len(values["nodes"]):
        raise ConfigurationError(f"{source}: scenario: nodes names one twice; remove one.")
    return values
