"""Parameter files in ROS' layout, read and checked without ROS.

    /sfj/sfj_sim:              # a node: with its namespace, without one, or nested (sfj: {sfj_sim: ...})
      ros__parameters:
        rate: 500.0            # keys may be nested or dotted
    /**:                       # a wildcard: * is one part of the name, ** any number of parts
      ros__parameters: {...}

The YAML is that of `strict_yaml`.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import yaml

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.named_files import why_unreadable
from haptic_teleop_control.parameters import ParameterTable
from haptic_teleop_control.strict_yaml import parse_yaml, yaml_problem

_SECTION = "ros__parameters"
SCENARIO_FILE = "scenario.yaml"
"""What a scenario file is called that a command writes into a folder of results."""
MODEL_HEAD = "haptic_teleop_model"
"""Key with which a model file begins."""


def load_parameter_file(path: str | Path) -> dict[str, dict[str, Any]]:
    """Sections of the file: node name as written (nested namespaces joined by "/") -> {dotted key: value}.

    Raises ConfigurationError naming file, line or key, and remedy: unreadable file, invalid YAML, a key
    stated twice (dotted and nested spellings count as one), a section without `ros__parameters`.
    """
    path = Path(path)
    try:
        content = parse_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        why = why_unreadable(path, error, SCENARIO_FILE)
        raise ConfigurationError(f"{path}: cannot be read: {why}") from error
    except yaml.YAMLError as error:
        raise ConfigurationError(f"{path}: {yaml_problem(error)}") from None
    if not isinstance(content, dict) or not content:
        raise ConfigurationError(f"{path}: holds no node; write `node_name:` and below it `{_SECTION}:`.")
    if MODEL_HEAD in content:
        raise ConfigurationError(
            f"{path}: this is a model file, and a parameter file is needed, such as a scenario file, whose "
            "parameters name models (sfj_sim: stage1.model)."
        )
    sections: dict[str, dict[str, Any]] = {}
    _collect(path, "", content, sections)
    return sections


def parameters_for(
    sections: Mapping[str, Mapping[str, Any]], node: str, known: Container[str] | None = None
) -> dict[str, Any]:
    """What the sections say for one node: wildcards first, so that a section with the node's own name wins.

    known: keys that the node has, such as its table; what a wildcard says to others is then left out.
    `node` with a leading "/" is a full name and must match as ROS matches it; a bare name matches the section
    of that node in any namespace, which is what a run without ROS wants.
    """
    merged: dict[str, Any] = {}
    for wildcard in (True, False):
        for name, values in sections.items():
            if is_wildcard(name) == wildcard and _matches(name, node):
                merged.update(
                    {key: value for key, value in values.items()
                     if not wildcard or known is None or key in known}
                )  # fmt: skip
    return merged


def check_parameter_file(path: str | Path, tables: Mapping[str, ParameterTable]) -> dict[str, dict[str, Any]]:
    """All parameters of each node in `tables` (node name, full or bare -> its table), as the file states
    them.

    A key in a wildcard section may belong to any node that the wildcard matches. Raises ConfigurationError as
    `load_parameter_file` and `ParameterTable.check`, and for a section or a wildcard's key that belongs to no
    node.
    """
    sections = load_parameter_file(path)
    stated = {node: parameters_for(sections, node) for node in tables}
    tables = {node: table.for_values(stated[node], str(path)) for node, table in tables.items()}
    for name, values in sections.items():
        matched = [node for node in tables if _matches(name, node)]
        if not matched:
            nearest = difflib.get_close_matches(name.lstrip("/"), [node.lstrip("/") for node in tables], n=1)
            hint = f"did you mean {nearest[0]}?" if nearest else f"known are {', '.join(tables)}."
            raise ConfigurationError(f"{path}: {name} names no node of this configuration; {hint}")
        for key in values:
            if not any(key in tables[node] for node in matched):
                tables[matched[0]].check(
                    {key: values[key]}, str(path)
                )  # raises, naming the nearest parameter
    return {
        node: table.check(parameters_for(sections, node, table), str(path)) for node, table in tables.items()
    }


def is_wildcard(name: str) -> bool:
    """Whether a section's name may match several nodes."""
    return "*" in name


def _matches(section: str, node: str) -> bool:
    parts = section.strip("/").split("/")
    wanted = node.strip("/").split("/")
    if not node.startswith("/"):
        # A bare name stands for that node in any namespace, so only the last part can speak about it.
        return parts[-1] == "**" or _part(parts[-1], wanted[-1])
    return _match_parts(parts, wanted)


def _match_parts(pattern: list[str], parts: list[str]) -> bool:
    if not pattern:
        return not parts
    if pattern[0] == "**":
        return any(_match_parts(pattern[1:], parts[start:]) for start in range(len(parts) + 1))
    return bool(parts) and _part(pattern[0], parts[0]) and _match_parts(pattern[1:], parts[1:])


def _part(pattern: str, part: str) -> bool:
    return re.fullmatch(re.escape(pattern).replace(r"\*", "[^/]*"), part) is not None


def _collect(
    path: Path, prefix: str, content: Mapping[Any, Any], sections: dict[str, dict[str, Any]]
) -> None:
    for key, value in content.items():
        name = f"{prefix}/{str(key).strip('/')}" if prefix else str(key)
        if not isinstance(value, dict):
            raise ConfigurationError(f"{path}: {name} has no `{_SECTION}:`; write it below the node's name.")
        if _SECTION not in value:
            if not value:
                raise ConfigurationError(
                    f"{path}: {name} is empty; write `{_SECTION}:` below it or remove it."
                )
            _collect(path, name, value, sections)
            continue
        if len(value) > 1:
            other = next(entry for entry in value if entry != _SECTION)
            raise ConfigurationError(
                f"{path}: {name}: {other} stands beside `{_SECTION}:`; move it below that line."
            )
        if name in sections:
            raise ConfigurationError(f"{path}: {name} is stated twice; merge the two sections.")
        entries = value[_SECTION]
        if not isinstance(entries, dict):
            raise ConfigurationError(
                f"{path}: {name}: `{_SECTION}:` is empty; write `key: value` lines or remove it."
            )
        sections[name] = {}
        _flatten(path, name, "", entries, sections[name])


def _flatten(path: Path, node: str, prefix: str, entries: Mapping[Any, Any], flat: dict[str, Any]) -> None:
    for key, value in entries.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            _flatten(path, node, f"{name}.", value, flat)
        elif name in flat:
            raise ConfigurationError(f"{path}: node {node}: parameter {name} is stated twice; remove one.")
        else:
            flat[name] = value
