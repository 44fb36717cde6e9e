"""`haptic-teleop dataset`: look at recordings before anything is estimated.

What is there, what is suspicious (gaps, duplicates, jitter, stamps that run backward, values that are no
numbers), and, with a model, whether the excitation can teach it: spectrum, and the standard errors to expect.
"""

from __future__ import annotations

import argparse
import shlex
import time
from collections.abc import Sequence

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_sim.model import load_model
from haptic_teleop_sysid.commands.treatment_options import (
    add_mapping_option,
    add_treatment_options,
    treatment_of,
    treatment_words,
)
from haptic_teleop_sysid.logs.story import tell
from haptic_teleop_sysid.report import claim_output_directory, save_png
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.dataset_content import as_json
from haptic_teleop_sysid.runs.dataset_look import judgement, look
from haptic_teleop_sysid.runs.dataset_page import dataset_page
from haptic_teleop_sysid.runs.dataset_pictures import signals_picture


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    model = None if arguments.model is None else load_model(arguments.model)
    console, screen = Console(), Console(stderr=True)
    with screen.status("reading recordings"):
        bags, treatment = dict.fromkeys(arguments.bag), treatment_of(arguments)
        looks = {bag: look(bag, model, treatment, arguments.mapping) for bag in bags}
    tell(screen, {name: one.recording.experiment for name, one in looks.items()}, arguments.verbose)
    output = claim_output_directory(arguments.output, "dataset.json", arguments.overwrite)
    with screen.status("writing the report"):
        for number, one in enumerate(looks.values(), start=1):
            name = "dataset.png" if number == 1 else f"dataset-{number}.png"
            save_png(signals_picture(one), output / name)
        path = dataset_page(looks, next_steps(arguments)).write(output / "report.html")
        content = {"schema": 1, "recordings": [as_json(name, one) for name, one in looks.items()]}
        content |= {"runtime_s": time.perf_counter() - began, "version": tool_version()}
        write_json(output / "dataset.json", content)
    for name, one in looks.items():
        for _, sentence in judgement(one):
            say(console, f"{name}: {sentence}")
    say(console, f"report: {path}")
    return 0


def next_steps(arguments: argparse.Namespace) -> list[tuple[str, str]]:
    """Return what to do after a look at these recordings, each with its command."""
    bags = list(dict.fromkeys(arguments.bag))
    more = ["--mapping", arguments.mapping] if arguments.mapping else []
    if arguments.model is None:
        words = ["haptic-teleop", "dataset", "--bag", *bags, *more, "--model", "MODEL.yaml"]
        what = "Look again with a model, to hear whether the excitation teaches it."
        return [(what, shlex.join([*words, "--output", f"{arguments.output}_with_model"]))]
    words = ["haptic-teleop", "estimate", "--model", arguments.model, "--bag", *bags, *more]
    treatment = treatment_words(arguments)
    what = "Estimate the model's parameters; add `--validation BAG` to check them on another recording."
    return [(what, shlex.join([*words, *treatment, "--output", f"{arguments.output}_estimate"]))]


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0 when the report was written, whatever it says; 2 for bad arguments or unusable
    recordings."""
    return run_command(run, None if argv is None else list(argv))


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop dataset", description="Look at recordings before anything is estimated."
    )
    parser.add_argument("--bag", nargs="+", required=True, metavar="BAG", help="recordings")
    parser.add_argument("--model", metavar="MODEL.yaml", help="judge the excitation for this model")
    parser.add_argument(
        "--output", required=True, metavar="DIR", help="where report.html and dataset.json go"
    )
    parser.add_argument(
        "--overwrite", action="store_true", help="replace the results of an earlier run in DIR"
    )
    add_mapping_option(parser)
    add_treatment_options(parser)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
