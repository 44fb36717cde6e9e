"""`haptic-teleop stiffness`: joint stiffness from hung weights (thesis 2.4.3).

A known torque T bends the joint by delta; T = Ks delta + T0, a straight line through the table by least
squares, T0 for what bends the joint before the first weight (friction, a zero that is off).
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike
from rich.console import Console
from scipy.special import stdtrit

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.robots import SFJ_STAGES, STAGES
from haptic_teleop_sysid.commands.hand_table import read_table
from haptic_teleop_sysid.commands.line_fit import line_fit
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import write_json

COLUMNS = ("torque", "deflection")


@dataclass(frozen=True)
class Stiffness:
    """value, std and interval (95 %, Student) of Ks, N·m/rad; offset of the line, N·m; residual, N·m rms;
    count of rows; worst: row (from 1) farthest from the line, in standard deviations of the residual."""

    value: float
    std: float
    interval: tuple[float, float]
    offset: float
    residual: float
    count: int
    worst: tuple[int, float]


def joint_stiffness(torque: ArrayLike, deflection: ArrayLike) -> Stiffness:
    """The line through (n >= 3) torques, N·m, and deflections, rad, of one joint, signs as they are (both
    of one sign for a spring). Raises ConfigurationError when the deflections do not differ, or Ks comes out
    negative."""
    t, d = np.asarray(torque, dtype=np.float64), np.asarray(deflection, dtype=np.float64)
    if len(t) < 3 or np.ptp(d) <= 1e-9 * max(float(np.max(np.abs(d))), 1e-12):
        raise ConfigurationError("stiffness: give at least three rows with different deflections.")
    line = line_fit(d, t)
    if line.slope <= 0.0:
        raise ConfigurationError(
            f"stiffness: the table gives {line.slope:.4g} N·m/rad, and no spring is negative: check the "
            "signs (counter-clockwise positive for both)."
        )
    half = line.std * float(stdtrit(len(t) - 2, 0.975))
    interval = (line.slope - half, line.slope + half)
    row = int(np.argmax(np.abs(line.left)))
    far = float(abs(line.left[row])) / line.residual if line.residual > 0.0 else 0.0
    return Stiffness(line.slope, line.std, interval, line.offset, line.residual, len(t), (row + 1, far))


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    arguments = _parser().parse_args(argv)
    table = read_table(arguments.table, COLUMNS, fewest=3)
    scale = np.pi / 180.0 if arguments.degrees else 1.0
    found = joint_stiffness(table["torque"], table["deflection"] * scale)
    console = Console()
    low, high = found.interval

    say(
        console,
        f"Ks = {found.value:.4f} N·m/rad, standard error {found.std:.4f}, 95 % {low:.4f} to {high:.4f}",
    )
    say(
        console,
        f"{found.count} rows, {found.residual * 1e3:.3g} mN·m rms about the line, offset "
        f"{found.offset * 1e3:.3g} mN·m",
    )
    if found.worst[1] > 2.5:
        say(
            console,
            f"row {found.worst[0]} lies {found.worst[1]:.1f} standard deviations off the line: measure it "
            "again",
        )
    if arguments.stage is not None:
        nominal = SFJ_STAGES[arguments.stage].stiffness
        inside = "inside" if low <= nominal <= high else "outside"
        say(console, f"{arguments.stage} is configured with {nominal} N·m/rad, {inside} this interval")
    if arguments.output is not None:
        write_json(arguments.output, {"schema": 1, "unit": "N*m/rad", **asdict(found)})
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0 with a result, 2 for a table that gives none."""
    return run_command(run, None if argv is None else list(argv))


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop stiffness", description="Joint stiffness from a table of torque and deflection."
    )
    parser.add_argument(
        "table", metavar="TABLE.csv", help="CSV or YAML, columns torque (N·m) and deflection (rad)"
    )
    parser.add_argument("--degrees", action="store_true", help="the deflections are in degrees")
    parser.add_argument("--stage", choices=STAGES, help="compare with what this stage is configured with")
    parser.add_argument("--output", metavar="FILE.json", help="write the result there, too")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
