"""`haptic-teleop discover`: the whole chain once. A "real" robot with concealed physics is recorded in
scenario 1 and in two acquisitions, `diagnose` gets the recordings and the lab's model, the label is opened,
and the augmented model goes into the simulated plant.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.mujoco_robot import mujoco_installed, mujoco_module
from haptic_teleop_sysid.discovery.chain import discover
from haptic_teleop_sysid.discovery.conclusion import RESULT
from haptic_teleop_sysid.discovery.overlay import AUGMENTED, LAB, REFITTED, mean
from haptic_teleop_sysid.discovery.steps import Say, Settings, StepFailed
from haptic_teleop_sysid.report import claim_output_directory, numbered_output_directory
from haptic_teleop_sysid.report.terminal import say

PLANTS = {"auto": None, "mujoco": "mujoco_sim", "sfj_sim": "sfj_sim"}


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    if arguments.plant == "mujoco":
        mujoco_module()
    mujoco = arguments.plant == "mujoco" or (arguments.plant == "auto" and mujoco_installed())
    if arguments.output is None:
        output = numbered_output_directory(f"output/discover-{arguments.seed}")
    else:
        output = claim_output_directory(arguments.output, RESULT)
        if any(output.iterdir()):
            raise ConfigurationError(f"--output {output} is not empty: choose another directory.")
    screen = Console(stderr=True)

    @contextmanager
    def live() -> Iterator[Say]:
        if not screen.is_terminal:
            yield lambda line: say(screen, f"      {line}")
            return
        with screen.status("diagnose") as status:
            yield lambda line: status.update(Text(line))

    plant = PLANTS[arguments.plant]
    settings = Settings(arguments.seed, plant, mujoco, arguments.lockstep, arguments.seconds)
    try:
        content = discover(settings, output, partial(say, screen), live)
    except StepFailed as failure:
        print(f"discover: {failure}", file=sys.stderr)
        return 1
    except KeyboardInterrupt as leaving:
        told = f"interrupted; {output} holds what was made so far, which is no whole result"
        raise KeyboardInterrupt(told) from leaving
    for line in summary(content):
        print(line)
    print(f"report: {output / 'report.html'}")
    return 0


def summary(content: dict[str, Any]) -> list[str]:
    """The outcome in a few lines for the terminal."""
    hidden, said = content["label"]["truth"][0], content["said"] or ["nothing named"]
    lines = [
        f"hidden:   {hidden['effect']} @ {hidden['location']}",
        f"verdict:  {content['verdict']}: {'; '.join(said)}",
        f"outcome:  {content['outcome']} ({content['sentence']})",
    ]
    for part in ("scenario1", "validation"):
        lab, refitted, augmented = (mean(content["fits"][part][name]) for name in (LAB, REFITTED, AUGMENTED))
        lines.append(
            f"fit to {part}: {lab:.1f} % (lab's model) -> {augmented:.1f} % (augmented); "
            f"re-estimated without the finding: {refitted:.1f} %"
        )
    return lines


def main(argv: list[str] | None = None) -> int:
    """Entry point: 0 when the chain ran to its end, whatever was said; 1 when a step failed; 2 for bad
    arguments."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="haptic-teleop discover", description=__doc__)
    parser.add_argument(
        "--seed", type=_seed, required=True, metavar="N", help="seed of the robot and of its hidden physics"
    )
    parser.add_argument(
        "--output", type=Path, metavar="DIR", help="an empty or new directory (default: output/discover-N)"
    )
    parser.add_argument(
        "--plant", choices=tuple(PLANTS), default="auto",
        help="the real robot: MuJoCo's physics, drawn from what MuJoCo can express; or sfj_sim with a "
        "temporary effect file; auto draws from the whole table, for MuJoCo where that can express it",
    )  # fmt: skip
    parser.add_argument(
        "--lockstep", action="store_true", help="make the recordings without ROS or clock, in seconds"
    )
    parser.add_argument(
        "--seconds", type=_seconds, default=25.0, metavar="S", help="length of an acquisition (default: 25)"
    )
    return parser


def _seed(text: str) -> int:
    if not text.isdigit():
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, 0 or more")
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 4.0 <= seconds <= 300.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds from 4 to 300")
    return seconds


if __name__ == "__main__":
    raise SystemExit(main())
