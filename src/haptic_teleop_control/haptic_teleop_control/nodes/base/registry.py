"""The nodes by the names of their executables, and their parameter tables.

Modules are imported by name when one is asked for, so that nothing here depends on a particular node.
"""

from __future__ import annotations

import difflib
import importlib
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.front_door import executables
from haptic_teleop_control.parameters import ParameterTable

SEPARATE = ("recorder",)
"""Nodes that write to disk: never in the control process."""


def node_names() -> list[str]:
    """Executables that are nodes and may share a process: those whose module lies in a `nodes`
    sub-package."""
    runners = (*SEPARATE, "composed", "scenario")
    return [
        name for name, (target, _) in executables().items() if ".nodes." in target and name not in runners
    ]


def node_class(name: str) -> type[Any]:
    """The class of a node by the name of its executable. Raises ConfigurationError for what is none."""
    if name in SEPARATE:
        raise ConfigurationError(
            f"{name} writes to disk and never shares the control process; start it by itself."
        )
    if name not in node_names():
        nearest = difflib.get_close_matches(name, node_names(), n=1)
        hint = f"did you mean {nearest[0]}?" if nearest else f"choose from {', '.join(node_names())}."
        raise ConfigurationError(f"{name} is not a node; {hint}")
    return _module(name).NODE


def parameter_tables() -> list[ParameterTable]:
    """The tables of all nodes of the project, the recorder's too."""
    separate = [_module(name).NODE for name in SEPARATE]
    return [node.TABLE for node in (*separate, *map(node_class, node_names()))]


def _module(name: str) -> Any:
    return importlib.import_module(executables()[name][0].split(":")[0])
