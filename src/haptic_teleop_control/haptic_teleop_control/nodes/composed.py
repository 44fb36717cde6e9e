"""Several nodes in one process: one executor, one interpreter, no hop over the network stack between
processes.

This is the 1 kHz default on one machine; as separate processes the same nodes run distributed.
"""

from __future__ import annotations

from collections.abc import Sequence

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.nodes.base.node_help import node_help
from haptic_teleop_control.nodes.base.registry import node_class, node_names
from haptic_teleop_control.nodes.base.run import run_nodes
from haptic_teleop_control.nodes.launching.parent import OPTION

HELP = """composed: runs several nodes in one process, as 1 kHz on one machine needs it

usage: haptic-teleop composed NODE [NODE ...] [--ros-args [--params-file FILE] [-p NODE:NAME:=VALUE] ...]
       haptic-teleop composed NODE [NODE ...] --help        the topics and parameters of these nodes

NODE is the name of an executable that is a node: """

def _composed(argv: Sequence[str]) -> int:
    end = list(argv).index("--ros-args") if "--ros-args" in argv else len(argv)
    own, ros = list(argv[:end]), list(argv[end:])
    names = [argument for argument in own if not argument.startswith("-")]
    options = [argument for argument in own if argument.startswith("-")]
    armed = OPTION in options
    options = [option for option in options if option != OPTION]
    for option in options:
        if option not in ("-h", "--help"):
            raise ConfigurationError(f"{option} is not an option of composed; see `composed --help`.")
    if options:
        print("\n\n".join(node_help(node_class(name)) for name in names) or HELP + ", ".join(node_names()))
        return 0
    if not names:
        raise ConfigurationError(f"composed: no node; name at least one of {', '.join(node_names())}.")
    if len(set(names)) < len(names):
        raise ConfigurationError("composed: a node is named twice; start the second in its own process.")
    return run_nodes([node_class(name) for name in names], [OPTION, *ros] if armed else ros)


def main(argv: list[str] | None = None) -> int:
    return run_command(_composed, argv)
