"""`haptic-teleop encoders`: drive against joint encoder over the range, with the joint unloaded (thesis
2.4.2).

joint = scale x drive + offset; the scale is the error of the joint encoder's gearing, so that gearing x
scale is the gearing that would make it one. What remains is the largest angle by which the two disagree.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike
from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import read_recording
from haptic_teleop_control.robots import JOINT_ENCODER_GEARING, STAGES
from haptic_teleop_sysid.commands.hand_table import read_table
from haptic_teleop_sysid.commands.line_fit import line_fit
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import write_json

COLUMNS = ("drive", "joint")
LARGEST_ERROR = np.radians(0.2)
"""rad, reached over +-80 degrees with the gearing 6.23 (thesis 2.4.2)."""


@dataclass(frozen=True)
class EncoderCheck:
    """scale (joint per drive) with its std; gearing that would make it one; offset, rad; error: largest
    difference of the two, offset removed, rad; remaining: the same after correcting the gearing; span:
    range of the drive, rad."""

    scale: float
    std: float
    gearing: float
    offset: float
    error: float
    remaining: float
    span: tuple[float, float]


def check_encoders(
    drive: ArrayLike, joint: ArrayLike, gearing: float = JOINT_ENCODER_GEARING
) -> EncoderCheck:
    """Compare angles (n >= 3), rad, of drive and joint encoder of an unloaded joint; `gearing` made the
    joint's.

    Raises ConfigurationError when the drive did not move by at least 0.1 rad.
    """
    a, b = np.asarray(drive, dtype=np.float64), np.asarray(joint, dtype=np.float64)
    if len(a) < 3 or not np.ptp(a) >= 0.1:
        raise ConfigurationError(
            "encoders: the drive moved by less than 0.1 rad: move it over its whole range."
        )
    line = line_fit(a, b)
    apart = b - a
    error = float(np.max(np.abs(apart - np.mean(apart))))
    span = (float(np.min(a)), float(np.max(a)))
    remaining = float(np.max(np.abs(line.left)))
    return EncoderCheck(line.slope, line.std, gearing * line.slope, line.offset, error, remaining, span)


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    if arguments.bag is not None:
        states = read_recording(arguments.bag).topic("/sfj/joint_states")
        stage = arguments.stage
        drive, joint = (states.signal(f"{stage}_{place}", "position") for place in ("motor", "arm"))
        good = np.isfinite(drive) & np.isfinite(joint)
        drive, joint = drive[good], joint[good]
    else:
        table = read_table(arguments.table, COLUMNS, fewest=3)
        unit = np.pi / 180.0 if arguments.degrees else 1.0
        drive, joint = table["drive"] * unit, table["joint"] * unit
    found = check_encoders(drive, joint, arguments.gearing)
    console = Console()

    low, high = np.degrees(found.span)
    say(
        console,
        f"over {low:.1f} to {high:.1f} degrees the encoders differ by {np.degrees(found.error):.3f} "
        "degrees at most",
    )
    say(
        console,
        f"joint per drive {found.scale:.6f} +- {found.std:.6f}: gearing {found.gearing:.4f} in place of "
        f"{arguments.gearing:g} would leave {np.degrees(found.remaining):.3f} degrees",
    )
    kept = "kept" if found.error <= LARGEST_ERROR else "not kept"
    say(console, f"the 0.2 degrees of the calibration are {kept}")
    if arguments.output is not None:
        write_json(arguments.output, {"schema": 1, "unit": "rad", **asdict(found)})
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0 with a result (kept or not), 2 for a table or recording that gives none."""
    return run_command(run, None if argv is None else list(argv))


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop encoders", description="Drive against joint encoder of an unloaded joint."
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--table", metavar="TABLE.csv", help="CSV or YAML, columns drive and joint, rad")
    source.add_argument("--bag", metavar="BAG", help="a recording of a slow motion over the range")
    parser.add_argument("--stage", choices=STAGES, default=STAGES[0], help="of the recording (%(default)s)")
    parser.add_argument("--degrees", action="store_true", help="the table is in degrees")
    parser.add_argument(
        "--gearing", type=float, default=JOINT_ENCODER_GEARING, help="of the joint encoder (%(default)s)"
    )
    parser.add_argument("--output", metavar="FILE.json", help="write the result there, too")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
