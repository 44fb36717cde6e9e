"""`estimate` of every recording of a folder: each for itself, with one overview."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from haptic_teleop_control.counted import counted
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.many.each import claim, each
from haptic_teleop_sysid.many.estimates import (
    doubted_sentence,
    estimate_jobs,
    together,
    write_estimates,
)
from haptic_teleop_sysid.many.estimates_page import estimates_page
from haptic_teleop_sysid.many.folder import Listing, find_recordings
from haptic_teleop_sysid.many.kept import DONE
from haptic_teleop_sysid.many.options import means_of
from haptic_teleop_sysid.report import with_error
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.estimation_run import Choices


def run_many(arguments: argparse.Namespace, model: Model, choices: Choices, began: float) -> int:
    """Estimate from each recording of a folder for itself; returns the exit status."""
    listing = find_recordings(arguments.bags)
    with claim(Path(arguments.output)) as output:
        return _into(output, arguments, model, choices, listing, began)


def _into(
    output: Path,
    arguments: argparse.Namespace,
    model: Model,
    choices: Choices,
    listing: Listing,
    began: float,
) -> int:
    if choices.mapping is not None:
        choices = replace(choices, mapping=str(Path(choices.mapping).resolve()))
    with_page = not arguments.no_report
    jobs = estimate_jobs(listing.found, model, arguments.validation or [], choices, with_page, output)
    console = Console()
    for line in listing.told:
        say(console, line)
    outcomes, known = each("estimating", jobs, means_of(arguments))
    if known:
        Console(stderr=True).print(f"{known} of {len(jobs)} were known from earlier runs", highlight=False)
    all_ = together(outcomes)
    content = {
        "schema": 1,
        "together": all_,
        "passed_over": listing.passed,
        "recordings": {n: {k: v for k, v in o.items() if k != "key"} for n, o in outcomes.items()},
        "runtime_s": round(time.perf_counter() - began, 2),
        "version": tool_version(),
    }
    write_json(output / "estimates.json", content)
    write_estimates(outcomes, output / "estimates.csv")
    report = estimates_page(model, outcomes, with_page).write(output / "report.html")
    for name, row in all_.items():
        text = f"{name}: {with_error(row['mean'], row['std'], row['unit'])}"
        differ = "" if row["alike"] else ", which differ"
        say(console, f"{text} of {counted(row['count'], 'recording')}{differ}")
    if (doubted := doubted_sentence(outcomes)) is not None:
        say(console, doubted)
    unusable = {n: o["message"] for n, o in outcomes.items() if o["status"] != DONE}
    for name, why in unusable.items():
        say(console, f"not used: {name}: {why}")
    say(console, f"report: {report}")
    return 0 if len(unusable) < len(outcomes) else 2
