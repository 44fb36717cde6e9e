"""A node's parameters: declared from its table, changed only through it, read from the command line.

rclpy would take a misspelt key in a parameter file without a word and refuse `10` where `10.0` is meant. So
the files and `-p` values of `--ros-args` are read here alone, checked against the table, and handed to the
node as overrides.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.named_files import located, names_a_file
from haptic_teleop_control.nodes.base.registry import parameter_tables
from haptic_teleop_control.nodes.base.ros_arguments import RosArguments
from haptic_teleop_control.parameter_files import is_wildcard, load_parameter_file, parameters_for
from haptic_teleop_control.parameters import Parameter, ParameterTable

ROS_OWN = {
    "start_type_description_service": Parameter("start_type_description_service", True),
    "qos_overrides": None,
}
"""First parts of parameters that every ROS node has; in no node's table. None: rclpy checks it."""
def declare_parameters(node: Node, table: ParameterTable) -> dict[str, Any]:
    """Declares the table on `node` and returns all values.

    Later changes are checked by the table, then by `node.apply_parameters(values)` with all values after
    the change; a ConfigurationError from either refuses the change with its sentence as the reason, and
    nothing changes. The returned dictionary follows the changes.
    """
    # Those that name a module come first: they decide which others there are.
    first = [entry for entry in table if entry.plugin]
    declared = {entry.name: _declare(node, entry) for entry in first}
    table = table.for_values({name: entry.value for name, entry in declared.items()})
    declared |= {entry.name: _declare(node, entry) for entry in table if entry.name not in declared}
    values = table.check({name: _plain(entry.value) for name, entry in declared.items()}, node.get_name())

    def change(requested: list[RosParameter]) -> SetParametersResult:
        wanted = {entry.name: _plain(entry.value) for entry in requested if not _is_ros_own(entry.name)}
        if not wanted:
            return SetParametersResult(successful=True)
        try:
            changed = table.change(values, wanted, node.get_name())
            node.apply_parameters(changed)  # type: ignore[attr-defined]
        except ConfigurationError as refusal:
            node.get_logger().warning(f"parameter refused: {refusal}")
            # Who asked knows whom.
            reason = str(refusal).removeprefix(f"{node.get_name()}: ")
            return SetParametersResult(successful=False, reason=reason)
        values.update(changed)
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(change)
    return values


def _declare(node: Node, entry: Parameter) -> RosParameter:
    if node.has_parameter(entry.name):  # use_sim_time, which every node declares itself
        return node.get_parameter(entry.name)
    return node.declare_parameter(entry.name, entry.default, _descriptor(entry))


def overrides(
    table: ParameterTable, full_name: str, arguments: RosArguments, neighbours: Iterable[ParameterTable] = ()
) -> list[RosParameter]:
    """What `--params-file` and `-p` say for the node `full_name` (with namespace), checked, in the declared
    types.

    neighbours: tables of other nodes in the same process; what a wildcard section or a `-p` without a node
    name holds for one of them is no error here. Raises ConfigurationError naming file, node, key and
    remedy.
    """
    table = _with_brought(table, full_name, arguments)
    neighbours = list(neighbours)

    def elsewhere(key: str) -> bool:
        return key not in table and any(key in neighbour for neighbour in neighbours)

    stated: dict[str, Any] = {}
    for file in arguments.parameter_files:
        sections = {
            name: {
                key: value
                for key, value in values.items()
                if not (is_wildcard(name) and (elsewhere(key) or _speaks_to_others(key, table)))
            }
            for name, values in load_parameter_file(file).items()
        }
        values = _check_stated(table, _section_values(sections, full_name), str(file))
        stated.update({key: _beside(key, value, Path(file).parent) for key, value in values.items()})
    for target, key, value in arguments.parameters:
        if _means(target, full_name) and not (target is None and elsewhere(key)):
            stated.update(_check_stated(table, {key: value}, "--ros-args"))
    own = {key: value for key, value in stated.items() if not _is_ros_own(key)}
    checked = stated | table.check(own, ", ".join(arguments.parameter_files) or "--ros-args")
    return [RosParameter(key, value=checked[key]) for key in stated]


def _with_brought(table: ParameterTable, full_name: str, arguments: RosArguments) -> ParameterTable:
    """`table` with the parameters of the modules that the arguments name for this node."""
    stated: dict[str, Any] = {}
    for file in arguments.parameter_files:
        stated.update(_section_values(load_parameter_file(file), full_name))
    for target, key, value in arguments.parameters:
        if _means(target, full_name):
            stated[key] = value
    plugins = {entry.name for entry in table if entry.plugin}
    named = {key: value for key, value in stated.items() if key in plugins}
    return table.for_values(named, ", ".join(arguments.parameter_files) or "--ros-args")


def _means(target: str | None, full_name: str) -> bool:
    """Whether the node named in `-p node:key:=value` is this one."""
    return target in (None, full_name.rsplit("/", 1)[-1], full_name.lstrip("/"))


def _section_values(sections: Mapping[str, Mapping[str, Any]], full_name: str) -> dict[str, Any]:
    # A section without a namespace means this node in whatever namespace it runs: our namespaces are set in
    # code.
    bare = {name: values for name, values in sections.items() if "/" not in name}
    qualified = {name: values for name, values in sections.items() if "/" in name}
    wildcards = {name: values for name, values in qualified.items() if is_wildcard(name)}
    exact = {name: values for name, values in qualified.items() if not is_wildcard(name)}
    return {
        **parameters_for(wildcards, full_name),
        **parameters_for(bare, full_name.rsplit("/", 1)[-1]),
        **parameters_for(exact, full_name),
    }


def _speaks_to_others(key: str, table: ParameterTable) -> bool:
    # In a process of its own a node knows no neighbours, but a wildcard may mean them: the key must then be
    # a parameter of some node of the project. Looked up only when one turns up that is not our own.
    if key in table or _is_ros_own(key):
        return False
    return any(key in other for other in parameter_tables())


def _check_stated(table: ParameterTable, stated: Mapping[str, Any], source: str) -> dict[str, Any]:
    stated = table.spelt_out(stated, source)
    own = {key: value for key, value in stated.items() if not _is_ros_own(key)}
    required = {entry.name: entry.default for entry in table if entry.required}
    checked = stated | table.check({**required, **own}, source)
    for key in stated.keys() - own.keys():
        entry = ROS_OWN[key.split(".", 1)[0]]
        if entry is not None and (problem := entry.problem(checked[key])):
            raise ConfigurationError(f"{source}: node {table.node_name}: parameter {key} {problem}.")
    return {key: checked[key] for key in stated}


def _beside(name: str, value: Any, folder: Path) -> Any:
    """As `located`; a file that is nowhere is said to be missing beside the parameter file."""
    found = located(name, value, folder)
    missing = value and names_a_file(name) and not Path(found).is_file()
    return str((folder / value).resolve()) if missing else found


def _plain(value: Any) -> Any:
    return value if isinstance(value, (bool, int, float, str)) else list(value)


def _is_ros_own(name: str) -> bool:
    return name.split(".", 1)[0] in ROS_OWN


def _descriptor(entry: Parameter) -> ParameterDescriptor:
    unit = f" ({entry.unit})" if entry.unit else ""
    described = ParameterDescriptor(
        name=entry.name,
        description=f"{entry.meaning}{unit}",
        additional_constraints=entry.limits(),
        read_only=not entry.runtime,
    )
    if entry.is_list or (entry.minimum is None and entry.maximum is None):
        return described
    if entry.element_type is float:
        lower = -sys.float_info.max if entry.minimum is None else float(entry.minimum)
        upper = sys.float_info.max if entry.maximum is None else float(entry.maximum)
        if not entry.infinite:
            described.floating_point_range = [FloatingPointRange(from_value=lower, to_value=upper)]
    elif entry.element_type is int:
        lower = -(2**63) if entry.minimum is None else int(entry.minimum)
        upper = 2**63 - 1 if entry.maximum is None else int(entry.maximum)
        described.integer_range = [IntegerRange(from_value=lower, to_value=upper, step=0)]
    return described
