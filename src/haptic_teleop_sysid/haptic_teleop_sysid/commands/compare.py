"""`haptic-teleop compare`: simulate models on the input of recordings and report the fit of each output in
percent.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands.treatment_options import add_mapping_option
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.story import reported, tell
from haptic_teleop_sysid.recordings.preparation import refuse_huge
from haptic_teleop_sysid.report import claimed, save_png
from haptic_teleop_sysid.report.terminal import print_conclusion, say
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.comparison import Comparison, compare
from haptic_teleop_sysid.runs.comparison_pictures import comparison_pictures
from haptic_teleop_sysid.runs.comparison_report import comparison_page, comparison_table
from haptic_teleop_sysid.runs.comparison_verdict import conclusion, nearest_model
from haptic_teleop_sysid.runs.next_command import diagnose_command


def as_json(result: Comparison) -> dict[str, Any]:
    """Return the content of compare.json: `fits` and `rms` are {model: {bag: {signal: number}}}."""
    bags = list(result.data)
    return {
        "schema": 1,
        "fits": {name: {bag: result.fits[name, bag].percent for bag in bags} for name in result.models},
        "rms": {name: {bag: result.fits[name, bag].rms for bag in bags} for name in result.models},
        "units": {
            signal: unit for dataset in result.data.values() for signal, unit in dataset.units().items()
        },
        "windows": {
            bag: {"seconds": chosen.seconds, "why": chosen.why, "samples": chosen.spans}
            for bag, chosen in result.windows.items()
        },
        "recordings": {
            bag: {
                "samples": len(dataset),
                "period_s": dataset.dt,
                "start_s": dataset.start,
                "end_s": float(dataset.time[-1]),
                "input": dataset.input_source,
                "resampled": dataset.resampled,
                "problems": dataset.problems,
            }
            for bag, dataset in result.data.items()
        },
        "residuals": {
            name: {
                bag: {
                    r.signal: {"rms_rad": r.rms, "auto_outside": r.outside[0], "cross_outside": r.outside[1]}
                    for r in result.residuals.get((name, bag), [])
                }
                for bag in bags
            }
            for name in result.models
        },
        "parameters": {name: model.parameter_values() for name, model in result.models.items()},
        "parameter_fit": {
            name: {
                "converged": found.converged,
                "evaluations": found.evaluations,
                "cost": found.cost,
                "fled": found.fled,
            }
            for name, found in result.fitted.items()
        },
    }


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    _no_repetition("--model", arguments.model)
    _no_repetition("--bag", arguments.bag)
    models = {name: replace(load_model(name), source=name) for name in arguments.model}
    for bag in arguments.bag:
        refuse_huge(bag)
    console, progress = Console(), Console(stderr=True)
    with claimed(arguments.output, "compare.json", arguments.overwrite) as output:
        with progress.status("reading recordings"):
            recordings = {bag: open_recording(bag, arguments.mapping) for bag in arguments.bag}
        read = {bag: recording.experiment for bag, recording in recordings.items()}
        tell(progress, read, arguments.verbose)
        odd = {bag: recording.problems for bag, recording in recordings.items()}
        with progress.status("simulating"), reported(odd):
            span = None if arguments.range is None else (arguments.range[0], arguments.range[1])
            result = compare(
                models, recordings, arguments.window, span, arguments.fit_parameters, arguments.allow_gaps
            )
        with progress.status("writing the report"):
            content = as_json(result)
            for name, path in _fitted_paths(result, output).items():
                result.models[name].save(path)
                content["parameter_fit"][name]["model"] = path.name
            pictures = comparison_pictures(result)
            for number, figure in enumerate(pictures.values(), start=1):
                save_png(figure, output / ("compare.png" if number == 1 else f"compare-{number}.png"))
            command = diagnose_command(
                nearest_model(result),
                arguments.bag,
                [],
                f"{Path(arguments.output)}_diagnosed",
                arguments.mapping,
            )
            report = comparison_page(result, pictures, command).write(output / "report.html")
            content |= {"runtime_s": time.perf_counter() - began, "version": tool_version()}
            write_json(output / "compare.json", content)
    for title, table in comparison_table(result).items():
        say(console, title)
        console.print(table)
    print_conclusion(console, *conclusion(result, command))
    for bag, dataset in result.data.items():
        for problem in dataset.problems:
            say(progress, f"note: {bag}: {problem}")
    say(console, f"report: {report}")
    return 0


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when the fits were computed, 2 for bad arguments or files."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(prog="haptic-teleop compare", description=__doc__)
    parser.add_argument(
        "--model",
        nargs="+",
        required=True,
        metavar="MODEL.yaml",
        help="model files; the first is what the others are compared with",
    )
    parser.add_argument("--bag", nargs="+", required=True, metavar="BAG", help="recordings of that joint")
    parser.add_argument(
        "--output", required=True, metavar="DIR", help="where compare.json, report.html and pictures go"
    )
    parser.add_argument(
        "--window", type=_window, metavar="SECONDS|whole",
        help="simulate over consecutive windows of this length, or the whole (default: whole, 4 s where the "
        "recording is closed loop or the first model drifts)",
    )  # fmt: skip
    parser.add_argument(
        "--range", nargs=2, type=float, metavar=("START", "END"), help="use only this part, s from the start"
    )
    parser.add_argument(
        "--fit-parameters",
        action="store_true",
        help="first fit each model's free parameters to the first bag",
    )
    parser.add_argument(
        "--allow-gaps", action="store_true", help="leave holes in a recording out instead of refusing it"
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace the results of an earlier run in DIR"
    )
    add_mapping_option(parser)
    return parser


def _window(text: str) -> float | str:
    if text == "whole":
        return text
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0.0
    if not 0.0 < seconds < float("inf"):
        raise argparse.ArgumentTypeError(
            f"{text!r} is neither a number of seconds above zero nor the word whole"
        )
    return seconds


def _no_repetition(option: str, names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise ConfigurationError(f"{option} names {name} twice: give each once.")


def _fitted_paths(result: Comparison, output: Path) -> dict[str, Path]:
    paths: dict[str, Path] = {}
    for name in result.fitted:
        stem, number = f"{Path(name).stem}_fitted", 1
        while output / f"{stem}{'' if number == 1 else f'_{number}'}.yaml" in paths.values():
            number += 1
        paths[name] = output / f"{stem}{'' if number == 1 else f'_{number}'}.yaml"
    return paths


if __name__ == "__main__":
    raise SystemExit(main())
