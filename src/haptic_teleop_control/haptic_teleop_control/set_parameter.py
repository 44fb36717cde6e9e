"""`haptic-teleop set NODE PARAMETER VALUE`: one parameter of a running node, without `ros2`."""

from __future__ import annotations

from collections.abc import Sequence

import yaml

from haptic_teleop_control.command_line import ArgumentParser, positive, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.plugins import load_object
from haptic_teleop_control.strict_yaml import parse_value

CLIENT = "haptic_teleop_control.nodes.parameter_client:change"
"""Loaded when it is needed, because it needs ROS 2."""
_REMEDY = "write a number, true, a text or a list of one of them."


def value_of(text: str) -> bool | int | float | str | list[bool | int | float | str]:
    """The value that a text on the command line is, read as in a parameter file: `0.5`, `true`, `[1.0, 2.0]`.

    Raises ConfigurationError for YAML that is no value of a parameter.
    """
    try:
        value = parse_value(text)
    except yaml.YAMLError as error:
        raise ConfigurationError(f"the value {text!r} is no YAML: {_REMEDY}") from error
    whole = value if isinstance(value, list) else [value]
    if not whole or not all(isinstance(v, (bool, int, float, str)) for v in whole):
        raise ConfigurationError(f"the value {text!r} is none: {_REMEDY}")
    return value


def main(argv: Sequence[str] | None = None) -> int:
    """The command `set`: exit status 0 when it was done, 1 when the node refused."""
    return run_command(_main, argv)


def _main(argv: list[str]) -> int:
    parser = ArgumentParser(
        prog="haptic-teleop set",
        description="Change a parameter of a running node. `haptic-teleop NODE --help` says which may.",
        epilog="example: haptic-teleop set force_controller stage1.lambda 0.8",
    )
    parser.add_argument("node", metavar="NODE", help="such as force_controller or /sfj/sfj_sim")
    parser.add_argument("parameter", metavar="PARAMETER", help="such as stage1.lambda")
    parser.add_argument("value", metavar="VALUE", help="as in a parameter file: 0.5, true, [1.0, 2.0]")
    parser.add_argument(
        "--wait", type=positive, default=10.0, metavar="S", help="for the node to be found (default: 10 s)"
    )
    options = parser.parse_args(_negative_value_last(argv))
    value = value_of(options.value)
    return load_object(CLIENT, "CLIENT")(options.node, options.parameter, value, options.wait)


def _negative_value_last(argv: list[str]) -> list[str]:
    """`argv` with a value such as -1e-3 or -.inf behind `--`, where argparse takes it for no option."""
    for index, text in enumerate(argv):
        if text.startswith("-") and text[1:2] in tuple(".0123456789") and argv[index - 1] != "--wait":
            return [*argv[:index], *argv[index + 1 :], "--", text]
    return argv
