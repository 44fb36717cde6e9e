"""`haptic-teleop diagnose`: why do simulation and recording differ? Locates the mismatch, names the physics
that was left out, models it, and shows your model, re-estimated and augmented, on other recordings.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.commands.diagnose_many import run_many
from haptic_teleop_sysid.commands.treatment_options import add_mapping_option
from haptic_teleop_sysid.diagnosis.inputs.cuts import refuse_too_long
from haptic_teleop_sysid.diagnosis.report.forecast import DiagnosisForecast, pass_seconds
from haptic_teleop_sysid.diagnosis.report.summary import summary
from haptic_teleop_sysid.diagnosis.usable import records_of, refuse_unusable
from haptic_teleop_sysid.logs.reading import is_foreign
from haptic_teleop_sysid.logs.story import tell
from haptic_teleop_sysid.many.options import add_means_options, refuse_means
from haptic_teleop_sysid.report import claimed
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.run_progress import RunProgress
from haptic_teleop_sysid.runs.diagnosis_run import Options, diagnose_into, load, refuse_too_many

MOST_NULLS = 1000


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    refuse_misfits(arguments)
    refuse_repeated([*(arguments.estimation or []), *arguments.validation, *arguments.test])
    models = [replace(load_model(path), source=path) for path in arguments.model]
    if len(models) > 1 or arguments.bags:
        return run_many(arguments, models, began)
    refuse_means(arguments, "--bags or several models")
    return run_one(arguments, models[0], began)


def run_one(arguments: argparse.Namespace, model: Model, began: float) -> int:
    """Diagnose one joint from one set of recordings."""
    bags = [*arguments.estimation, *arguments.validation, *arguments.test]
    refuse_too_long([bag for bag in bags if not is_foreign(Path(bag))], model)
    console, screen = Console(), Console(stderr=True)
    forecast = DiagnosisForecast(arguments.nulls, os.cpu_count() or 1)
    options = Options(arguments.nulls, arguments.mapping, not arguments.no_report)
    with (
        claimed(arguments.output, "diagnosis.json", arguments.overwrite) as output,
        RunProgress(screen, "diagnose", forecast) as progress,
    ):
        progress.say("reading recordings")
        groups = (arguments.estimation, arguments.validation, arguments.test)
        estimation, validation, test = ([load(bag, model, arguments.mapping) for bag in g] for g in groups)
        refuse_too_many([*estimation, *validation, *test])
        read = {d.name: d.experiment for d in (*estimation, *validation, *test)}
        tell(screen, read, arguments.verbose)
        refuse_unusable(estimation, validation, test)  # before anything is compiled
        progress.say("timing one pass over the recordings")
        forecast.unit = pass_seconds(model, records_of(estimation))
        content, report = diagnose_into(
            model, (estimation, validation, test), output, options, began, progress.say
        )
    for name, problems in content["recordings"].items():
        for problem in problems:
            say(screen, f"note: {name}: {problem}")
    say(console, summary(content))
    if report is not None:
        say(console, f"report: {report}")
    return 0


def refuse_misfits(arguments: argparse.Namespace) -> None:
    """Raise ConfigurationError for --estimation and --bags together or neither, and where nothing judges."""
    if bool(arguments.bags) == bool(arguments.estimation):
        raise ConfigurationError("give either --estimation with --validation, or --bags.")
    if arguments.estimation and not arguments.validation:
        raise ConfigurationError(
            "--estimation needs --validation: other recordings that judge what was found."
        )


def refuse_repeated(bags: list[str]) -> None:
    """Raise ConfigurationError for a recording that is given twice: what was fitted to, or chose, proves
    nothing of other recordings."""
    places = [Path(bag).resolve() for bag in bags]
    for bag, place in zip(bags, places, strict=True):
        if places.count(place) > 1:
            raise ConfigurationError(
                f"{bag} is given twice: estimation, validation and test need different recordings."
            )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) > MOST_NULLS:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to {MOST_NULLS}")
    return int(text)


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when a verdict was reached, 2 for bad arguments or an unusable recording."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop diagnose",
        description=__doc__,
        epilog="Exit status: 0 a verdict was reached (of several: at least one, the others are listed), 2 "
        "bad arguments or unusable recordings, 1 a failure of the program.",
    )
    parser.add_argument(
        "--model",
        nargs="+",
        required=True,
        metavar="MODEL.yaml",
        help="your model; several, one for each joint, are diagnosed side by side, into DIR/JOINT, with one "
        "page that ranks them",
    )
    parser.add_argument("--estimation", nargs="+", metavar="BAG", help="recordings to fit the models to")
    parser.add_argument(
        "--bags",
        nargs="+",
        metavar="DIR",
        help="instead: each recording of a folder for itself, into DIR/RECORDING; without --validation its "
        "last third is the validation recording",
    )
    parser.add_argument(
        "--validation",
        nargs="+",
        default=[],
        metavar="BAG",
        help="other recordings, of another amplitude or band, on which a finding must stand up",
    )
    parser.add_argument(
        "--test",
        nargs="+",
        default=[],
        metavar="BAG",
        help="recordings that are only simulated: neither fitted to nor used to choose (default: last third "
        "of the validation, where that is 60 s or longer)",
    )
    parser.add_argument(
        "--output",
        required=True,
        metavar="DIR",
        help="where diagnosis.json, augmented_model.yaml and report.html go",
    )
    parser.add_argument(
        "--nulls",
        type=_count,
        default=0,
        metavar="N",
        help="simulate N sets of recordings in which nothing is missing, and diagnose each: how many raise a "
        "false alarm? A finding must score higher than the best of them; N = 19 gives a significance level "
        "of 5 %%",
    )
    add_mapping_option(parser)
    add_means_options(parser)
    parser.add_argument("--no-report", action="store_true", help="no page: for many diagnoses in a row")
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="replace the results of an earlier run in DIR (several joints or recordings go on from there)",
    )
    parser.add_argument(
        "--allow-gaps",
        action="store_true",
        help="without effect: recordings are always cut apart at their holes",
    )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
