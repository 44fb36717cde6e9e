"""Command-line options that the commands over many recordings share."""

from __future__ import annotations

import argparse
from collections.abc import Callable

from haptic_teleop_control.errors import ConfigurationError

from .each import Means


def add_means_options(parser: argparse.ArgumentParser) -> None:
    """Add --jobs, --dask and --afresh."""
    add = parser.add_argument
    add(
        "--jobs",
        type=whole_number(1, 10_000),
        default=-1,
        metavar="N",
        help="processes at once (default: all cores)",
    )
    add(
        "--dask",
        metavar="ADDRESS",
        help="scheduler of a Dask cluster that sees the same files, or `local`",
    )
    add("--afresh", action="store_true", help="compute again what an earlier run kept in the output folder")


def refuse_means(arguments: argparse.Namespace, otherwise: str) -> None:
    """Raise ConfigurationError where options are given that mean nothing for a single run."""
    given = [name for name in ("jobs", "dask", "afresh") if getattr(arguments, name) not in (-1, None, False)]
    if given:
        raise ConfigurationError(f"--{given[0]} goes with {otherwise}: leave it out for a single run.")


def means_of(arguments: argparse.Namespace) -> Means:
    """What the options say."""
    return Means(arguments.jobs, arguments.dask, arguments.afresh)


def whole_number(lowest: int, highest: int) -> Callable[[str], int]:
    """Return what reads a whole number in a range."""

    def read(text: str) -> int:
        if not text.isdecimal() or not lowest <= int(text) <= highest:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {lowest} to {highest}")
        return int(text)

    return read


def chance(text: str) -> float:
    """A probability that is worth stating."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.001 <= value <= 0.9:
        raise argparse.ArgumentTypeError(f"{text!r} is not a probability from 0.001 to 0.9")
    return value
