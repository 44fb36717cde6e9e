"""YAML as people write it into settings, models and `-p` values: one dialect, wherever it stands.

It is plain data as of `yaml.safe_load`, with these differences. A key stated twice in one mapping is refused,
where PyYAML silently takes the last one. 1e-3 and -.5 are numbers, as they are to ROS and to YAML 1.2, where
PyYAML takes them for text; 12:30, 1_000, 0b1 and 2026-01-31 are text, where PyYAML makes 750, 1000, 1 and a
date of them.
"""

from __future__ import annotations

import copy
import re
from functools import lru_cache
from typing import Any

import yaml

_TAG = "tag:yaml.org,2002:"

_SCALARS = (
    ("bool", r"yes|Yes|YES|no|No|NO|true|True|TRUE|false|False|FALSE|on|On|ON|off|Off|OFF", "yYnNtTfFoO"),
    ("int", r"[-+]?(0|[1-9]\d*|0[0-7]+|0x[0-9a-fA-F]+)", "-+0123456789"),
    (
        "float",
        r"[-+]?(\d+\.\d*|\.\d+)([eE][-+]?\d+)?|[-+]?\d+[eE][-+]?\d+|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
    ),
    ("null", r"~|null|Null|NULL|", ("~", "n", "N", "")),
    ("merge", r"<<", "<"),
)
"""Type, how its plain scalars look, their first characters. What looks like none of these is text."""


def parse_yaml(text: str) -> Any:
    """The content of `text`. Raises yaml.YAMLError, of which `yaml_problem` says what and where."""
    try:
        return copy.deepcopy(_parsed(text))
    except RecursionError:
        raise yaml.YAMLError("nested too deeply") from None


def parse_value(text: str) -> Any:
    """What `text` means behind `key: ` in a file; None where it is empty. Raises yaml.YAMLError."""
    content = parse_yaml(f"value: {text}")
    if not isinstance(content, dict) or list(content) != ["value"]:
        raise yaml.YAMLError("more than one value")
    return content["value"]


def dump_yaml(content: Any, default_flow_style: bool | None = False) -> str:
    """`content` as YAML in its own order of keys; `parse_yaml` and PyYAML give back the same.

    default_flow_style: as in PyYAML. Raises yaml.YAMLError for anything but plain data.
    """
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False, default_flow_style=default_flow_style)


def yaml_problem(error: yaml.YAMLError) -> str:
    """Line, column, problem and remedy; to be put behind the name of the file."""
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or getattr(error, "reason", None) or str(error)
    where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark is not None else ""
    return f"{where}{problem or 'it is not YAML'}; correct that line."


@lru_cache(maxsize=8)
def _parsed(text: str) -> Any:
    # Remembered, because every node of a process reads the same file several times.
    return yaml.load(text, Loader=_StrictLoader)  # a SafeLoader


class _StrictLoader(yaml.SafeLoader):
    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except (ValueError, AttributeError, KeyError, IndexError) as error:  # PyYAML's way of saying it
            value = str(node.value)[:40] if isinstance(node, yaml.ScalarNode) else "this"
            kind = node.tag.removeprefix(_TAG)
            raise yaml.constructor.ConstructorError(
                None, None, f"{value} cannot be read as {kind}", node.start_mark
            ) from error

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            if key_node.tag == f"{_TAG}merge":
                continue
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, (str, int, float, bool)):
                raise yaml.constructor.ConstructorError(
                    None, None, "a key must be a word", key_node.start_mark
                )
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"{key} is stated twice; remove one", key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


class _Dumper(yaml.SafeDumper):
    """It quotes what either dialect would not read as text."""


_StrictLoader.yaml_implicit_resolvers = {}  # none of PyYAML's own
for _kind, _pattern, _first in _SCALARS:
    for _class in (_StrictLoader, _Dumper):
        _class.add_implicit_resolver(f"{_TAG}{_kind}", re.compile(rf"^(?:{_pattern})$"), list(_first))
