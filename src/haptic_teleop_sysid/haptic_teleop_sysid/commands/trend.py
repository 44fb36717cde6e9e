"""`haptic-teleop trend`: many recordings of one robot in time. Parameters with errors, simulated fits and
unexplained torque of each, control limits from the first ones, what changed since then, and what left
its limits first.
"""

from __future__ import annotations

import argparse
import shlex
import time
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from haptic_teleop_control.command_line import ArgumentParser, run_command
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.commands.diagnose import run as diagnose
from haptic_teleop_sysid.commands.treatment_options import (
    add_mapping_option,
    add_treatment_options,
    treatment_of,
)
from haptic_teleop_sysid.estimation.strategies import check_start
from haptic_teleop_sysid.many.characterise import characterise
from haptic_teleop_sysid.many.each import Job, claim, each
from haptic_teleop_sysid.many.folder import Listing, find_recordings
from haptic_teleop_sysid.many.limits import FEWEST, refuse_rare
from haptic_teleop_sysid.many.options import add_means_options, chance, means_of, whole_number
from haptic_teleop_sysid.many.trend import BESIDE, trend_of
from haptic_teleop_sysid.many.trend_page import trend_page, write_table
from haptic_teleop_sysid.many.trend_words import alarm_sentence, change_sentence, content, diagnose_commands
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.estimation_run import Choices

OUTSIDE = 3
"""Exit status with --check when a recording has left the limits, is broken, or could not be used."""


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    model = replace(load_model(arguments.model), source=arguments.model)
    check_start(model, {})
    refuse_rare(arguments.false_alarms / (len(model.free_parameters()) + BESIDE))  # now, not after hours
    listing = find_recordings(arguments.bags)
    with claim(Path(arguments.output)) as output:
        return _into(output, arguments, model, listing, began)


def _into(output: Path, arguments: argparse.Namespace, model: Model, listing: Listing, began: float) -> int:
    """Characterise what is new, draw and tell; returns the exit status."""
    choices = Choices(
        treatment=treatment_of(arguments),
        allow_gaps=True,
        mapping=None if arguments.mapping is None else str(Path(arguments.mapping).resolve()),
    )
    mapped = () if choices.mapping is None else (Path(choices.mapping),)
    settings = (replace(model, source=""), choices)
    jobs = [
        Job(
            f.name,
            output / "recordings" / f.name,
            (f.path, *mapped),
            characterise,
            (str(f.path.resolve()), model, choices),
            settings,
        )
        for f in listing.found
    ]
    console, screen = Console(), Console(stderr=True)
    outcomes, known = each("estimating", jobs, means_of(arguments))
    if known:
        screen.print(f"{known} of {len(jobs)} recordings were known from earlier runs", highlight=False)
    trend = trend_of(
        model,
        outcomes,
        {f.name: f.path for f in listing.found},
        arguments.reference,
        arguments.false_alarms,
        arguments.per_year,
        listing,
    )
    values = {c.quantity.name: c.centre for c in trend.charts if c.quantity.name in model.free_parameters()}
    new = output / "reference_model.yaml"
    replace(model.with_values(values), source="the reference of a trend").save(new)
    commands = diagnose_commands(trend, new, output / "diagnosis", choices.mapping)
    took = {"runtime_s": round(time.perf_counter() - began, 2), "version": tool_version()}
    write_json(output / "trend.json", content(trend, commands) | took)
    with screen.status("drawing"):
        write_table(trend, output / "trend.csv")
        report = trend_page(trend, commands).write(output / "report.html")

    say(console, change_sentence(trend))
    if trend.first is not None:
        say(
            console,
            f"first outside: {trend.points[trend.first].when}: {'; '.join(trend.reasons(trend.first))}",
        )
    for command, which in zip(commands, ("it", "the newest, where a change has grown"), strict=False):
        say(console, f"  look into {which}: {shlex.join(command)}")
    for name, why in trend.unusable:
        say(console, f"not used: {name}: {why}")
    for note in trend.told:
        say(console, f"note: {note}")
    say(console, alarm_sentence(trend))
    say(console, f"report: {report}")
    if arguments.diagnose and commands:
        diagnose([*commands[0][2:], "--jobs", "1"] if arguments.jobs == 1 else commands[0][2:])
    odd = trend.first is not None or trend.unusable or trend.damaged
    return OUTSIDE if arguments.check and odd else 0


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when a trend was made, whatever it says and whichever recordings could not
    be used (3 with --check); 2 for bad arguments, or too few recordings that can be used."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser(
        prog="haptic-teleop trend",
        description=__doc__,
        epilog="Exit status: 0 a trend was made (single recordings that cannot be used are listed), 2 bad "
        "arguments or too few usable recordings, 3 with --check when a recording left the limits, is "
        "broken or could not be used, 1 a failure of the program.",
    )
    add = parser.add_argument
    add("--model", required=True, metavar="MODEL.yaml", help="structure, effects and start values")
    add(
        "--bags",
        required=True,
        nargs="+",
        metavar="DIR",
        help="a folder of recordings (or recordings); their own time stamps put them in order, without any "
        "their names in a folder, else the order that is given",
    )
    add(
        "--output",
        required=True,
        metavar="OUT",
        help="where report.html, trend.json, trend.csv, reference_model.yaml and what was found in each "
        "recording go; with an OUT of an earlier run only new recordings are computed",
    )
    add(
        "--reference",
        type=whole_number(FEWEST, 10_000),
        default=12,
        metavar="N",
        help="the first N recordings say what is normal (default: %(default)s); fewer make wider limits",
    )
    add(
        "--false-alarms",
        type=chance,
        default=0.05,
        metavar="P",
        help="probability of any false alarm in a year without change, all charts together "
        "(default: %(default)s)",
    )
    add(
        "--per-year",
        type=whole_number(1, 2000),
        metavar="N",
        help="recordings a year (default: by the median of their distances)",
    )
    add("--diagnose", action="store_true", help="diagnose the first recording outside the limits")
    add("--check", action="store_true", help="exit with 3 when anything is out of order, for scheduled runs")
    add_means_options(parser)
    add_mapping_option(parser)
    add_treatment_options(parser)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
