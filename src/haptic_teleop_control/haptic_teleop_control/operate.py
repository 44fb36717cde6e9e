"""What the operator does to a running teleoperation, as a command: engage, disengage, swap, reset, state;
start and stop of the artificial command; pause, resume and step of simulated time; which devices are live."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from haptic_teleop_control.command_line import ArgumentParser, one_of, positive, run_command
from haptic_teleop_control.plugins import load_object

ACTS = {
    "engage": "couple master and slave when both are aligned; align them otherwise",
    "disengage": "end the coupling; the efforts ramp out",
    "swap": "exchange master and slave; refused while they are coupled",
    "reset": "leave a latched fault, through aligning",
    "start": "begin the signal generator's pattern",
    "stop": "end the pattern: its command goes to zero",
    "pause": "stop simulated time before its next tick",
    "resume": "let simulated time go on",
    "step": "one tick of simulated time, while it is paused",
    "state": "print the state: off, devices_ready, aligning, engaged or fault, and why it is not engaged",
    "devices": "print which device, transport and serial number each driver has, and what it measures",
}

CLIENT = "haptic_teleop_control.nodes.operator_client:call"
DEVICES = "haptic_teleop_control.nodes.operator_devices:devices"
"""Loaded when they are needed, because they need ROS 2."""

GENERATOR, COORDINATOR = "/signal_generator", "/time_coordinator"
OTHERS = {
    **dict.fromkeys(("start", "stop"), GENERATOR),
    **dict.fromkeys(("pause", "resume", "step"), COORDINATOR),
}
"""What another node than the controller does."""

NOT_THERE = "start a scenario with the same ROS_DOMAIN_ID first."
NOT_SIMULATED = (
    "time is not simulated here. Start a scenario with use_sim_time: true and the same ROS_DOMAIN_ID; real "
    "robots are stopped with disengage."
)


def main(argv: Sequence[str] | None = None) -> int:
    """The command `operate`: exit status 0 when it was done, 1 when the controller refused."""
    return run_command(_main, argv)


def _main(argv: list[str]) -> int:
    lines = [f"{act:<10} {meaning}" for act, meaning in ACTS.items()]
    parser = ArgumentParser(
        prog="haptic-teleop operate",
        description="Call a service of the running force controller, of the signal generator, or of the "
        "coordinator of simulated time.",
        epilog="\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("act", type=one_of(ACTS), choices=list(ACTS))
    parser.add_argument(
        "--controller",
        default="/force_controller",
        metavar="NAME",
        help="its name (default: /force_controller)",
    )
    parser.add_argument(
        "--wait", type=positive, default=10.0, metavar="S", help="for the node to be found (default: 10 s)"
    )
    options = parser.parse_args(argv)
    if options.act == "devices":
        return load_object(DEVICES, "DEVICES")(options.wait)
    node = OTHERS.get(options.act, options.controller)
    remedy = NOT_SIMULATED if node == COORDINATOR else NOT_THERE
    return load_object(CLIENT, "CLIENT")(node, options.act, options.wait, remedy)
