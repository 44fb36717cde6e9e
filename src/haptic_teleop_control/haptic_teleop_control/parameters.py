"""A node's parameters with unit, range and meaning, checked without ROS.

The table is what a node declares, what its documentation prints, and what a YAML file is checked against
before any node starts. `parameter_files` reads the files.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from haptic_teleop_control.errors import ConfigurationError

_TYPE_NAMES = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
}


@dataclass(frozen=True)
class Parameter:
    """One parameter; its type is the type of `default`: bool, int, float, str, or a non-empty list of one of
    them.

    minimum, maximum: inclusive bounds; above, below: exclusive bounds; of each element where it is a list.
    choices: the values allowed. infinite: whether `.inf` is a meaningful value (it then means "no limit").
    length: number of elements a list must have, None for any number but zero.
    runtime: whether it may change while the node runs. required: whether the file must state it.
    plugin: whether `module:object` may stand in place of one of the choices.
    Raises ValueError for a declaration that contradicts itself, among others a default outside its own range.
    """

    name: str
    default: Any
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] | None = None
    meaning: str = ""
    runtime: bool = False
    above: float | None = None
    below: float | None = None
    infinite: bool = False
    length: int | None = None
    required: bool = False
    plugin: bool = False

    def __post_init__(self) -> None:
        if self.is_list and not self.default:
            raise ValueError(f"parameter {self.name}: an empty list as default has no type")
        if self.element_type not in _TYPE_NAMES:
            raise ValueError(f"parameter {self.name}: {self.element_type.__name__} is not a parameter type")
        problem = self.problem(self.default)
        if problem:
            raise ValueError(f"parameter {self.name}: its default {problem}")

    @property
    def is_list(self) -> bool:
        return isinstance(self.default, (list, tuple))

    @property
    def element_type(self) -> type:
        """bool, int, float or str."""
        return type(self.default[0]) if self.is_list else type(self.default)

    def problem(self, value: Any) -> str | None:
        """What is wrong with `value`, as the rest of a sentence that names the remedy, or None."""
        if not self.is_list:
            return self._element_problem(value)
        if not isinstance(value, (list, tuple)):
            return f"is {value!r}; write a list, for example {list(self.default)}"
        if not value:
            return "is an empty list; write at least one element"
        if self.length is not None and len(value) != self.length:
            return f"has {len(value)} elements; write exactly {self.length}"
        for index, element in enumerate(value):
            problem = self._element_problem(element)
            if problem:
                return f"in element {index} {problem}"
        return None

    def convert(self, value: Any) -> Any:
        """`value` in the parameter's type, whole numbers as float where a number is wanted; after `problem`
        only."""
        if self.is_list:
            return [self.element_type(element) for element in value]
        return self.element_type(value)

    def limits(self) -> str:
        """The values allowed, for people: `0 < value <= 10`, `a | b`, or an empty text."""
        if self.choices is not None:
            own = ("module:object",) if self.plugin else ()
            return " | ".join(str(choice) for choice in (*self.choices, *own))
        lower = f"{self.minimum:g} <= " if self.minimum is not None else ""
        lower = f"{self.above:g} < " if self.above is not None else lower
        upper = f" <= {self.maximum:g}" if self.maximum is not None else ""
        upper = f" < {self.below:g}" if self.below is not None else upper
        return f"{lower}value{upper}" if lower or upper else ""

    def _element_problem(self, value: Any) -> str | None:
        wanted = self.element_type
        if wanted is float:
            fits = isinstance(value, (int, float)) and not isinstance(value, bool)
        else:
            fits = type(value) is wanted
        if not fits:
            hint = ""
            if (
                wanted is float
                and isinstance(value, str)
                and value.strip("+-.").lower() in ("inf", "infinity", "nan")
            ):
                hint = " (YAML writes infinity as .inf)"
            return f"is {value!r}; write {_TYPE_NAMES[wanted]}{hint}"
        if wanted in (int, float):
            if math.isnan(value) or (math.isinf(value) and not self.infinite):
                return f"is {value}; write a finite number"
            if not self._inside(value):
                unit = f" {self.unit}" if self.unit else ""
                return f"is {value:g}{unit}; choose {self.limits()}"
        if self.plugin and ":" in str(value):
            return None
        if self.choices is not None and value not in self.choices:
            nearest = _nearest(str(value), [str(choice) for choice in self.choices])
            return f"is {value!r}{nearest}; choose {self.limits()}"
        return None

    def _inside(self, value: float) -> bool:
        return not (
            (self.minimum is not None and value < self.minimum)
            or (self.maximum is not None and value > self.maximum)
            or (self.above is not None and value <= self.above)
            or (self.below is not None and value >= self.below)
        )


class ParameterTable:
    """The parameters of one node, in the order of declaration. Raises ValueError for a name declared
    twice.

    A text at the name of a group, `board: remote`, is short for that group's `.type`, where it has one and
    nothing is called so itself.

    brought: called with the values that are stated, gives the parameters which these bring along, such as
    those of a law from a module of the user's own; they replace parameters of the same name. It may raise
    ConfigurationError.
    """

    def __init__(
        self,
        node_name: str,
        parameters: Iterable[Parameter],
        brought: Callable[[Mapping[str, Any]], Iterable[Parameter]] | None = None,
    ) -> None:
        self.node_name = node_name
        self._brought = brought
        self._parameters: dict[str, Parameter] = {}
        for parameter in parameters:
            if parameter.name in self._parameters:
                raise ValueError(f"parameter {parameter.name} of {node_name} is declared twice")
            self._parameters[parameter.name] = parameter

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self._parameters.values())

    def __len__(self) -> int:
        return len(self._parameters)

    def __contains__(self, name: object) -> bool:
        return name in self._parameters or f"{name}.type" in self._parameters

    def __getitem__(self, name: str) -> Parameter:
        return self._parameters[name]

    def for_values(self, stated: Mapping[str, Any], source: str = "parameters") -> ParameterTable:
        """This table together with what the values `stated` bring along; itself where they bring nothing.

        Raises ConfigurationError naming `source` and node for a value that names what cannot be found.
        """
        if self._brought is None:
            return self
        try:
            more = {entry.name: entry for entry in self._brought(stated)}
        except ConfigurationError as error:
            raise ConfigurationError(f"{self._of(source)}: parameter {error}") from error
        return ParameterTable(self.node_name, (self._parameters | more).values()) if more else self

    def defaults(self) -> dict[str, Any]:
        """Every parameter's default; lists are copies."""
        return {parameter.name: parameter.convert(parameter.default) for parameter in self}

    def spelt_out(self, mapping: Mapping[str, Any], source: str = "parameters") -> dict[str, Any]:
        """`mapping` with the full names of what is stated in short. Raises ConfigurationError where both are
        stated."""
        full = dict(mapping)
        for short, value in mapping.items():
            name = f"{short}.type"
            if short in self._parameters or name not in self._parameters or not isinstance(value, str):
                continue
            if name in mapping:
                raise self._error(source, name, f"is stated twice, the other time as `{short}:`; remove one")
            full[name] = full.pop(short)
        return full

    def check(self, mapping: Mapping[str, Any], source: str = "parameters") -> dict[str, Any]:
        """All parameters of the node: `mapping` where it states them, the default elsewhere, in the declared
        types.

        Raises ConfigurationError naming `source`, node, key and remedy: unknown key (with the nearest known
        one), type, range, choice, non-finite number, length of a list, or a required parameter that is
        missing.
        """
        table = self.for_values(mapping, source)
        if table is not self:
            return table.check(mapping, source)
        checked = self.defaults()
        checked.update(self._checked(mapping, source))
        for parameter in self:
            if parameter.required and parameter.name not in mapping:
                raise self._error(
                    source, parameter.name, f"is missing; add it, for example {parameter.default!r}"
                )
        return checked

    def change(
        self, current: Mapping[str, Any], changes: Mapping[str, Any], source: str = "change"
    ) -> dict[str, Any]:
        """`current` with `changes`, both checked. Raises ConfigurationError as `check`, and for a parameter
        that may not change while the node runs."""
        table = self.for_values(current, source)
        if table is not self:
            return table.change(current, changes, source)
        checked = self._checked(changes, source)
        for name, value in checked.items():
            if not self[name].runtime and value != current.get(name):
                raise self._error(source, name, "cannot change while the node runs; set it before the start")
        return {**self.check(current, source), **checked}

    def _checked(self, mapping: Mapping[str, Any], source: str) -> dict[str, Any]:
        checked = {}
        for name, value in self.spelt_out(mapping, source).items():
            parameter = self._parameters.get(name)
            if parameter is None:
                nearest = (
                    self._of_group(str(name), value)
                    or _nearest(str(name), list(self._parameters))
                    or f"; known are {', '.join(self._parameters)}"
                )
                raise self._error(source, name, f"is not a parameter of this node{nearest}")
            problem = parameter.problem(value)
            if problem:
                raise self._error(source, name, problem)
            checked[name] = parameter.convert(value)
        return checked

    def _of_group(self, name: str, value: Any) -> str:
        """What to write where the name is that of a group of parameters: that one whose choice the value is,
        else any of them; empty where it is none."""
        group = [p for p in self if p.name.startswith(f"{name}.")]
        if not group:
            return ""
        meant = [p.name for p in group if p.choices and value in p.choices]
        said = f"did you mean {meant[0]}: {value}?" if meant else f"it has {', '.join(p.name for p in group)}"
        return f" but a group of them; {said}"

    def _error(self, source: str, name: str, problem: str) -> ConfigurationError:
        end = "" if problem.endswith("?") else "."
        return ConfigurationError(f"{self._of(source)}: parameter {name} {problem}{end}")

    def _of(self, source: str) -> str:
        """Where a parameter is stated; a node that checks its own is not named twice."""
        return source if source == self.node_name else f"{source}: node {self.node_name}"


def _nearest(name: str, known: list[str]) -> str:
    matches = difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f"; did you mean {matches[0]}?" if matches else ""
