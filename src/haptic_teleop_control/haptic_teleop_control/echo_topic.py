"""`haptic-teleop echo TOPIC`: what a running node publishes, as text, without `ros2`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from haptic_teleop_control.command_line import ArgumentParser, positive, run_command
from haptic_teleop_control.plugins import load_object

PRINTER = "haptic_teleop_control.nodes.topic_printer:print_messages"
"""Loaded when it is needed, because it needs ROS 2."""


def main(argv: Sequence[str] | None = None) -> int:
    """The command `echo`: exit status 0; 2 when nobody publishes on the topic."""
    return run_command(_main, argv)


def _main(argv: list[str]) -> int:
    parser = ArgumentParser(
        prog="haptic-teleop echo",
        description="Print the messages of a topic as YAML, until Ctrl-C.",
        epilog="example: haptic-teleop echo /sfj/joint_states --once",
    )
    parser.add_argument("topic", metavar="TOPIC", help="such as /sfj/joint_states")
    parser.add_argument("--once", action="store_true", help="one message: the next, or the latest kept")
    parser.add_argument("--count", type=_count, metavar="N", help="so many messages")
    parser.add_argument(
        "--wait", type=positive, default=10.0, metavar="S", help="for a publisher to be found (default: 10 s)"
    )
    options = parser.parse_args(argv)
    load_object(PRINTER, "PRINTER")(options.topic, 1 if options.once else options.count, options.wait)
    return 0


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of messages: write 1 or more")
    return int(text)
