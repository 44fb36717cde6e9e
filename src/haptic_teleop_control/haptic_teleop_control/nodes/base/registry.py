"""The nodes by the names of their executables, and their parameter tables.

Modules are imported by name when one is asked for, so that nothing here depends on a particular node.
"""

from __future__ import annotations

import importlib
from typing import Any

from haptic_teleop_control.front_door import executables
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.scenario_section import SEPARATE, node_names, refuse_no_node


def node_class(name: str) -> type[Any]:
    """The class of a node by the name of its executable. Raises ConfigurationError for what is none."""
    refuse_no_node(name)
    return _module(name).NODE


def parameter_tables() -> list[ParameterTable]:
    """The tables of all nodes of the project, the recorder's too."""
    separate = [_module(name).NODE for name in SEPARATE]
    return [node.TABLE for node in (*separate, *map(node_class, node_names()))]


def _module(name: str) -> Any:
    return importlib.import_module(executables()[name][0].split(":")[0])
