"""`haptic-teleop estimate`: estimate a model's parameters from recordings, and say how far they can be
trusted."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.dataset import DataSet, load_dataset
from haptic_teleop_sysid.estimation.gauss_newton import Limits
from haptic_teleop_sysid.estimation.records import records_from, with_trusted_input
from haptic_teleop_sysid.estimation.result import Estimate
from haptic_teleop_sysid.estimation.strategies import METHODS, check_start, estimate
from haptic_teleop_sysid.estimation_report import Result, as_json, fit_picture, page, tables, verdict
from haptic_teleop_sysid.excitation import at_values, refuse_idle
from haptic_teleop_sysid.fit import choose_windows, simulated_fit
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.preparation import (
    MOST_SAMPLES,
    Treatment,
    prepare,
    refuse_huge,
    with_damage_told,
)
from haptic_teleop_sysid.report import claim_output_directory, save_png
from haptic_teleop_sysid.residuals import residual_analysis
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.treatment_options import add_mapping_option, add_treatment_options, treatment_of


def load(
    bags: Sequence[str], model: Model, treatment: Treatment, allow_gaps: bool, mapping: str | None = None
) -> tuple[dict[str, DataSet], dict[str, list[str]]]:
    """Read, check and treat recordings, or logs by a `mapping`: data sets by bag, and what was done to each.

    Raises RecordingError or MismatchError in one sentence for what cannot be estimated from.
    """
    data: dict[str, DataSet] = {}
    told: dict[str, list[str]] = {}
    for bag in bags:
        refuse_huge(bag)
        recording = open_recording(bag, mapping)
        dataset = with_damage_told(load_dataset(recording, model, bag, allow_gaps), recording)
        refuse_idle(dataset)
        data[bag], told[bag] = prepare(dataset, recording, model, treatment)
        refuse_idle(data[bag])
        data[bag] = with_trusted_input(data[bag])
    return data, told


def run_estimate(
    model: Model,
    data: dict[str, DataSet],
    told: dict[str, list[str]],
    validation: Sequence[str] = (),
    method: str = "prediction-error",
    at_rest: bool = False,
    multi_start: int = 1,
    seed: int = 1,
    limits: Limits | None = None,
    progress: Progress | None = None,
) -> Result:
    """Estimate from the data sets that `validation` does not name, and judge the result on all of them."""
    used = [d for bag, d in data.items() if bag not in validation]
    if sum(len(d) for d in used) > MOST_SAMPLES:
        raise RecordingError(
            f"{', '.join(d.name for d in used)}: {sum(len(d) for d in used)} samples are more than the "
            f"{MOST_SAMPLES} that one estimate takes: choose a part with --range, or a lower --rate."
        )
    task = progress.add_task("estimating", total=1.0) if progress is not None else None

    def tell(what: str, share: float) -> None:
        if progress is not None and task is not None:
            progress.update(task, description=what, completed=share)

    found = estimate(
        model,
        used,
        method,
        at_rest=at_rest,
        multi_start=multi_start,
        seed=seed,
        limits=limits,
        cross_check=True,
        progress=tell,
    )
    tell("simulating", 1.0)
    fits, residuals = {}, {}
    for bag, dataset in data.items():
        windows = choose_windows(found.model, dataset)
        fits["start", bag] = simulated_fit(found.start, dataset, windows)
        fits["estimate", bag] = simulated_fit(found.model, dataset, windows)
        record = max(records_from(dataset), key=len)
        # Residuals are those of one step, whichever predictor gave the numbers.
        basis = found.fit if found.fit and not found.misled else at_values(found.model, [record])
        if math.isfinite(basis.log_likelihood):
            residuals[bag] = residual_analysis(basis, record)
    return Result(found, data, tuple(validation), fits, residuals, told)


def usable_model(found: Estimate) -> Model:
    """The model to save: where a parameter is not determined, the value that the search ended with stays in
    use, because the rest was estimated with it."""
    return replace(found.model, source="estimate")


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    bags, validation = arguments.bag, arguments.validation or []
    places = [Path(name).resolve() for name in [*bags, *validation]]
    for name, place in zip([*bags, *validation], places, strict=True):
        if places.count(place) > 1:
            raise ConfigurationError(f"{name} is given twice: estimate and validate on different recordings.")
    model = _changed(load_model(arguments.model), arguments)
    limits = dict(arguments.bound or [])
    check_start(model, limits)
    console, screen = Console(), Console(stderr=True)
    with screen.status("reading recordings"):
        data, told = load(
            [*bags, *validation], model, treatment_of(arguments), arguments.allow_gaps, arguments.mapping
        )
    output = claim_output_directory(arguments.output, "estimate.json", arguments.overwrite)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=screen, transient=True) as progress:
        result = run_estimate(
            model,
            data,
            told,
            validation,
            arguments.method,
            arguments.initial_state == "zero",
            arguments.multi_start,
            arguments.seed,
            limits,
            progress,
        )
    with screen.status("writing the report"):
        usable_model(result.estimate).save(output / "model.yaml")
        report = page(result)
        for number, bag in enumerate(data, start=1):
            save_png(fit_picture(result, bag), output / ("fit.png" if number == 1 else f"fit-{number}.png"))
        path = report.write(output / "report.html")
        write_json(
            output / "estimate.json",
            as_json(result) | {"runtime_s": time.perf_counter() - began, "version": tool_version()},
        )
    for table in tables(result):
        console.print(table)
    for _, sentence in verdict(result):
        console.print(sentence, markup=False, highlight=False)
    console.print(f"report: {path}", markup=False, highlight=False, soft_wrap=True)
    return 0


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when an estimate was made (honest about what it is worth), 2 for bad
    arguments or recordings."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="haptic-teleop estimate", description=__doc__)
    add = parser.add_argument
    add("--model", required=True, metavar="MODEL.yaml", help="structure, effects and start values")
    add("--bag", nargs="+", required=True, metavar="BAG", help="recordings to estimate from")
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
        help="starts; the further ones are drawn at random",
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
