"""The command-line options by which `estimate` and `dataset` treat recordings."""

from __future__ import annotations

import argparse

from haptic_teleop_control.command_line import positive
from haptic_teleop_sysid.recordings.preparation import Treatment


def add_treatment_options(parser: argparse.ArgumentParser) -> None:
    """Add --range, --lead-in, --offset, --detrend and --rate."""
    add = parser.add_argument
    add("--range", nargs=2, type=float, metavar=("START", "END"), help="use only this part, s from the start")
    add(
        "--lead-in",
        type=_lead_in,
        default="auto",
        metavar="SECONDS|auto|none",
        help="what to cut off before the experiment begins; auto: the recorded delay, or while nothing is "
        "commanded",
    )
    add(
        "--offset",
        choices=("auto", "remove", "keep"),
        default="auto",
        help="subtract the angles' mean in the lead-in (first 5 samples ignored); auto: unless an effect "
        "of the model "
        "depends on the angle",
    )
    add("--detrend", choices=("none", "constant", "linear"), default="none", help="of angles and input")
    add("--rate", type=positive, metavar="HZ", help="resample to the recorded rate divided by a whole number")


def add_mapping_option(parser: argparse.ArgumentParser) -> None:
    """Add --mapping and --verbose, for commands that take logs beside recordings."""
    parser.add_argument(
        "--mapping",
        metavar="MAPPING.yaml",
        help="how to read logs (CSV, MATLAB, npz, Parquet, bags) that are no recordings of joint states: see "
        "`import --help`; not needed where headers say all",
    )
    parser.add_argument(
        "-v", "--verbose", action="store_true", help="say column by column how logs were read"
    )


def treatment_of(arguments: argparse.Namespace) -> Treatment:
    """The treatment that the options describe."""
    span = None if arguments.range is None else (arguments.range[0], arguments.range[1])
    return Treatment(arguments.lead_in, arguments.offset, arguments.detrend, arguments.rate, span)


def treatment_words(arguments: argparse.Namespace) -> list[str]:
    """The options that were given and differ from what is done without them, as words of a command line."""
    words = [] if arguments.range is None else ["--range", *(f"{s:g}" for s in arguments.range)]
    words += [] if arguments.lead_in == "auto" else ["--lead-in", str(arguments.lead_in)]
    words += [] if arguments.offset == "auto" else ["--offset", arguments.offset]
    words += [] if arguments.detrend == "none" else ["--detrend", arguments.detrend]
    return words + ([] if arguments.rate is None else ["--rate", f"{arguments.rate:g}"])


def _lead_in(text: str) -> str | float:
    return text if text in ("auto", "none") else positive(text)
