"""`haptic-teleop estimate`: estimate a model's parameters from recordings, and say how far they can be
trusted."""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.commands.estimate_many import run_many
from haptic_teleop_sysid.commands.treatment_options import (
    add_mapping_option,
    add_treatment_options,
    treatment_of,
)
from haptic_teleop_sysid.estimation.strategies import METHODS, check_start
from haptic_teleop_sysid.logs.story import reported, tell
from haptic_teleop_sysid.many.options import add_means_options, refuse_means
from haptic_teleop_sysid.report import claimed
from haptic_teleop_sysid.report.terminal import print_conclusion, say
from haptic_teleop_sysid.run_progress import share_progress
from haptic_teleop_sysid.runs.estimation_report import tables
from haptic_teleop_sysid.runs.estimation_run import Choices, load, run_estimate, write_results
from haptic_teleop_sysid.runs.estimation_verdict import Commands, conclusion, notes, problems
from haptic_teleop_sysid.runs.next_command import again_command, diagnose_command


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    bags, validation = arguments.bag or [], arguments.validation or []
    if bool(bags) == bool(arguments.bags):
        raise ConfigurationError("give either --bag, for one estimate, or --bags, for one of each recording.")
    places = [Path(name).resolve() for name in [*bags, *validation]]
    for name, place in zip([*bags, *validation], places, strict=True):
        if places.count(place) > 1:
            raise ConfigurationError(f"{name} is given twice: estimate and validate on different recordings.")
    model = _changed(load_model(arguments.model), arguments)
    choices = Choices(
        arguments.method,
        arguments.initial_state == "zero",
        arguments.multi_start,
        arguments.seed,
        dict(arguments.bound or []),
        treatment_of(arguments),
        arguments.allow_gaps,
        arguments.mapping,
    )
    check_start(model, choices.limits)
    if arguments.bags:
        return run_many(arguments, model, choices, began)
    refuse_means(arguments, "--bags")
    console, screen = Console(), Console(stderr=True)
    with claimed(arguments.output, "estimate.json", arguments.overwrite) as output:
        with screen.status("reading recordings"):
            data, told = load([*bags, *validation], model, choices)
        tell(screen, {bag: dataset.experiment for bag, dataset in data.items()}, arguments.verbose)
        odd = {bag: dataset.problems for bag, dataset in data.items()}
        with share_progress(screen, "estimate") as progress, reported(odd):
            result = run_estimate(model, data, told, validation, choices, progress)
        commands = _next(argv, arguments)
        with screen.status("writing the report"):
            path = write_results(result, output, began, commands=commands)
    for table in tables(result):
        console.print(table)
    print_conclusion(console, *conclusion(result, commands))
    further = [problem.headline for problem in problems(result)[1:]]
    for sentence in [*further, *(text for status, text in notes(result) if status != "good")]:
        say(console, sentence)
    say(console, f"report: {path}")
    return 0


def _next(argv: list[str], arguments: argparse.Namespace) -> Commands:
    """What comes after this command line."""
    where = str(Path(arguments.output))
    diagnosed = diagnose_command(
        arguments.model, arguments.bag, arguments.validation or [], f"{where}_diagnosed", arguments.mapping
    )
    # The other methods have one start, whatever is asked for.
    more = ("--multi-start", "6", *(() if arguments.method == METHODS[0] else ("--method", METHODS[0])))
    return Commands(diagnosed, again_command("estimate", argv, f"{where}_again", *more))


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when an estimate was made (honest about what it is worth), 2 for bad
    arguments or recordings."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop estimate",
        description=__doc__,
        epilog="Exit status: 0 an estimate was made (of --bags: at least one, the others are listed), 2 bad "
        "arguments or unusable recordings, 1 a failure of the program.",
    )
    add = parser.add_argument
    add("--model", required=True, metavar="MODEL.yaml", help="structure, effects and start values")
    add("--bag", nargs="+", metavar="BAG", help="recordings to estimate from, all together")
    add(
        "--bags",
        nargs="+",
        metavar="DIR",
        help="instead: from each recording of a folder for itself, into DIR/RECORDING, with a table of all",
    )
    add("--no-report", action="store_true", help="with --bags: no page for each of them")
    add("--validation", nargs="+", metavar="BAG", help="recordings to judge the estimate on, not used for it")
    add("--output", required=True, metavar="DIR", help="where model.yaml, estimate.json and report.html go")
    add("--method", choices=METHODS, default=METHODS[0], help="default: %(default)s")
    add(
        "--initial-state",
        choices=("estimate", "zero"),
        default="estimate",
        help="zero: the joint rests at the first sample (default: %(default)s)",
    )
    add(
        "--multi-start",
        type=_count,
        default=1,
        metavar="N",
        help="starts; the further ones are drawn at random (prediction-error only)",
    )
    add("--seed", type=int, default=1, help="of the random starts (default: %(default)s)")
    add("--fix", nargs="+", default=[], metavar="NAME", help="parameters not to estimate, beside the model's")
    add(
        "--free",
        nargs="+",
        default=[],
        metavar="NAME",
        help="parameters to estimate although the model fixes them",
    )
    add("--start", nargs="+", type=_assignment, default=[], metavar="NAME=VALUE", help="start values")
    add("--bound", nargs="+", type=_bound, metavar="NAME=LOW:HIGH", help="bounds, beside the physical ones")
    add("--allow-gaps", action="store_true", help="leave holes in a recording out instead of refusing it")
    add("--overwrite", action="store_true", help="replace the results of an earlier run in DIR")
    add_means_options(parser)
    add_mapping_option(parser)
    add_treatment_options(parser)
    return parser


def _changed(model: Model, arguments: argparse.Namespace) -> Model:
    values = model.parameter_values()
    for name in [*arguments.fix, *arguments.free, *(n for n, _ in arguments.start)]:
        if name not in values:
            raise ConfigurationError(
                f"{arguments.model} has no parameter {name!r}: it has {', '.join(values)}."
            )
    for name in arguments.fix:
        if name in arguments.free:
            raise ConfigurationError(f"--fix and --free both name {name}: decide for one.")
    fixed = [n for n in dict.fromkeys([*model.fixed, *arguments.fix]) if n not in arguments.free]
    return replace(model.with_values(dict(arguments.start)), fixed=tuple(fixed))


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to 1000")
    return int(text)


def _assignment(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not name or not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} does not read NAME=VALUE with a finite number")
    return name, number


def _bound(text: str) -> tuple[str, tuple[float, float]]:
    name, _, span = text.partition("=")
    low, colon, high = span.partition(":")
    try:
        limits = (float(low), float(high))
    except ValueError:
        limits = (math.nan, math.nan)
    if not name or not colon or any(math.isnan(v) for v in limits):
        raise argparse.ArgumentTypeError(f"{text!r} does not read NAME=LOW:HIGH")
    return name, limits


if __name__ == "__main__":
    raise SystemExit(main())
