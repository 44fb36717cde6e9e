"""What `--ros-args` says about a node's name and parameters, read without ROS.

rcl reads the same arguments once more for remappings and log levels, but not the parameters: its YAML is
another one, which refuses [1, 2.0] and takes 1_000 for text. What is read here is handed to the node itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.strict_yaml import parse_value

_WITH_VALUE = ("--log-level", "--log-config-file", "--log-file-name", "-e", "--enclave")


@dataclass
class RosArguments:
    """parameter_files: in order of precedence, the last wins. parameters: (node or None, key, value).
    remaps: (node or None, from, to). other: arguments that are not ROS arguments. for_rcl: all arguments but
    the parameters."""

    parameter_files: list[str] = field(default_factory=list)
    parameters: list[tuple[str | None, str, Any]] = field(default_factory=list)
    remaps: list[tuple[str | None, str, str]] = field(default_factory=list)
    other: list[str] = field(default_factory=list)
    for_rcl: list[str] = field(default_factory=list)

    def full_name(self, name: str, namespace: str) -> str:
        """The node's full name after `-r __node:=` and `-r __ns:=`, such as `/sfj/sfj_sim`."""
        for target, old, new in self.remaps:
            if target in (None, name) and old in ("__node", "__name"):
                name = new
        for target, old, new in self.remaps:
            if target in (None, name) and old == "__ns":
                namespace = new
        namespace = namespace.strip("/")
        return f"/{namespace}/{name}" if namespace else f"/{name}"


def parse_ros_arguments(argv: Sequence[str]) -> RosArguments:
    """Raises ConfigurationError for an option without its value, a rule that is not `old:=new`, and a
    parameter's value that is not YAML."""
    found = RosArguments()
    arguments = iter(argv)
    inside = False
    for argument in arguments:
        if argument == "--ros-args":
            inside = True
        elif not inside:
            found.other.append(argument)
        elif argument == "--":
            inside = False
        elif argument == "--params-file":
            found.parameter_files.append(_value(arguments, argument))
            continue
        elif argument in ("-p", "--param"):
            found.parameters.append(_parameter(_value(arguments, argument), argument))
            continue
        found.for_rcl.append(argument)
        if argument in ("-r", "--remap"):
            found.for_rcl.append(_value(arguments, argument))
            found.remaps.append(_rule(found.for_rcl[-1], argument))
        elif argument in _WITH_VALUE:
            found.for_rcl.append(_value(arguments, argument))
    return found


def _value(arguments, option: str) -> str:
    value = next(arguments, None)
    if value is None:
        raise ConfigurationError(f"--ros-args {option}: its value is missing; write it after the option.")
    return value


def _parameter(text: str, option: str) -> tuple[str | None, str, Any]:
    node, key, value = _rule(text, option)
    try:
        return node, key, parse_value(value)
    except yaml.YAMLError as problem:
        raise ConfigurationError(
            f"--ros-args {option} {text}: what follows := is no value in YAML; quote it."
        ) from problem


def _rule(text: str, option: str) -> tuple[str | None, str, str]:
    old, separator, new = text.partition(":=")
    if not separator or not old:
        raise ConfigurationError(f"--ros-args {option} {text}: is no rule; write name:=value.")
    node, colon, rest = old.partition(":")
    return (node.lstrip("/"), rest, new) if colon else (None, old, new)
