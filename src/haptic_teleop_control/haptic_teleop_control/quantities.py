"""Settings as frozen dataclasses whose fields know their unit, range and meaning.

A field is declared once, with `quantity`; from it come the check at construction, the ROS parameter and the
line in the documentation, which therefore cannot disagree.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, field, fields
from typing import Any

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.parameters import Parameter

_KEY = "quantity"


def quantity(
    default: Any = MISSING, unit: str = "", meaning: str = "", *, name: str = "", **limits: Any
) -> Any:
    """A dataclass field; `limits` are those of `Parameter` (minimum, above, choices, infinite, ...).

    Without a default the field must be given. `name` is the parameter's name where it differs from the
    field's.
    """
    metadata = {_KEY: {"name": name, "unit": unit, "meaning": meaning, **limits}}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


def parameters_of(settings: Any, prefix: str = "", runtime: bool = True) -> list[Parameter]:
    """One Parameter per `quantity` field of the instance `settings`, with its values as defaults.

    Tuples become lists, because ROS knows lists only. Fields declared without `quantity` are left out.
    """
    found = []
    for entry in fields(settings):
        if _KEY in entry.metadata:
            options = dict(entry.metadata[_KEY])
            name = options.pop("name") or entry.name
            value = getattr(settings, entry.name)
            value = list(value) if isinstance(value, tuple) else value
            found.append(Parameter(f"{prefix}{name}", value, runtime=runtime, **options))
    return found


def check_quantities(settings: Any) -> None:
    """For `__post_init__`: every `quantity` within its type and range, whole numbers made float where one is
    wanted.

    Raises ConfigurationError naming the field and the remedy.
    """
    for entry in fields(settings):
        if _KEY not in entry.metadata:
            continue
        options = dict(entry.metadata[_KEY])
        name = options.pop("name") or entry.name
        value = getattr(settings, entry.name)
        # A value that fits serves as the declaration's example; only its type and limits are used here.
        parameter = Parameter(name, _example(entry, options), **options)
        problem = parameter.problem(list(value) if isinstance(value, tuple) else value)
        if problem:
            raise ConfigurationError(f"{name} {problem}.")
        converted = parameter.convert(value)
        object.__setattr__(settings, entry.name, tuple(converted) if parameter.is_list else converted)


def from_parameters(kind: type, values: Mapping[str, Any], prefix: str = "", **others: Any) -> Any:
    """An instance of the dataclass `kind` from flat values `prefix + name`, and `others` for its other
    fields; a field that is not stated keeps its default. Raises ConfigurationError as the dataclass
    itself."""
    arguments = dict(others)
    for entry in fields(kind):
        if _KEY in entry.metadata:
            name = prefix + (entry.metadata[_KEY]["name"] or entry.name)
            if name in values:
                value = values[name]
                arguments[entry.name] = tuple(value) if isinstance(value, list) else value
    return kind(**arguments)


def settings_of_each(nominal: Iterable[tuple[str, Any]], values: Mapping[str, Any]) -> list[Any]:
    """Settings of several joints from the flat values of a node, in the order of `nominal`.

    nominal: (prefix, settings) for each joint: what holds where `values` has no `prefix + name`.
    Raises ConfigurationError naming the parameter with its prefix.
    """
    found = []
    for prefix, settings in nominal:
        stated = to_parameters(settings, prefix) | dict(values)
        try:
            found.append(from_parameters(type(settings), stated, prefix))
        except ConfigurationError as error:
            raise ConfigurationError(f"{prefix}{error}") from error
    return found


def parameters_of_each(nominal: Iterable[tuple[str, Any]]) -> list[Parameter]:
    """The parameters of several joints, one after the other; `nominal` as in `settings_of_each`."""
    return [parameter for prefix, settings in nominal for parameter in parameters_of(settings, prefix)]


def to_parameters(settings: Any, prefix: str = "") -> dict[str, Any]:
    """The reverse of `from_parameters`: {prefix + name: value}, tuples as lists."""
    return {parameter.name: parameter.default for parameter in parameters_of(settings, prefix)}


def _example(entry: Any, options: Mapping[str, Any]) -> Any:
    if entry.default is not MISSING:
        return list(entry.default) if isinstance(entry.default, tuple) else entry.default
    lower = options.get("minimum", options.get("above"))
    return 1.0 if lower is None else float(lower) + 1.0
