"""`diagnose` of several joints, or of every recording of a folder: each for itself, with one overview."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from rich.console import Console

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.many.diagnoses import folder_jobs, joint_jobs, refuse_twins
from haptic_teleop_sysid.many.each import claim, each
from haptic_teleop_sysid.many.folder import Listing, find_recordings
from haptic_teleop_sysid.many.kept import DONE
from haptic_teleop_sysid.many.options import means_of
from haptic_teleop_sysid.many.ranking import (
    overview_content,
    overview_page,
    overview_sentence,
    percent,
    ranked,
    write_overview,
)
from haptic_teleop_sysid.report.terminal import say
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.diagnosis_run import Options


def run_many(arguments: argparse.Namespace, models: list[Model], began: float) -> int:
    """Diagnose each joint, and with --bags each recording, for itself, with one overview."""
    refuse_twins(models)
    listing = find_recordings(arguments.bags) if arguments.bags else Listing(())
    with claim(Path(arguments.output)) as output:
        return _into(output, arguments, models, listing, began)


def _into(
    output: Path, arguments: argparse.Namespace, models: list[Model], listing: Listing, began: float
) -> int:
    mapping = None if arguments.mapping is None else str(Path(arguments.mapping).resolve())
    options = Options(arguments.nulls, mapping, not arguments.no_report)
    groups = (tuple(arguments.estimation or ()), tuple(arguments.validation), tuple(arguments.test))
    if arguments.bags:
        jobs = folder_jobs(models, listing.found, groups, options, output)
    else:
        jobs = joint_jobs(models, groups, options, output)
    screen = Console(stderr=True)
    for line in listing.told:
        say(screen, line)
    outcomes, known = each("diagnosing", jobs, means_of(arguments))
    if known:
        screen.print(f"{known} of {len(jobs)} were known from earlier runs", highlight=False)
    content = overview_content(outcomes) | {"passed_over": listing.passed}
    content |= {"runtime_s": round(time.perf_counter() - began, 2), "version": tool_version()}
    write_json(output / "overview.json", content)
    write_overview(outcomes, output / "overview.csv")
    title = "Which recordings are wrong" if arguments.bags else "Which joints are wrong"
    report = overview_page(title, outcomes, options.page).write(output / "report.html")
    return told(outcomes, report)


def told(outcomes: dict[str, dict[str, Any]], report: Path) -> int:
    """Print the overview; returns the exit status."""
    console = Console()
    say(console, overview_sentence(outcomes))
    for number, name in enumerate(ranked(outcomes), start=1):
        o = outcomes[name]
        errors = f"error {percent(o['error'])} -> {percent(o['left'])}"
        slight = "slight, " if o["wrong"] and not o["matters"] else ""
        say(console, f"{number}. {name}: {o['verdict']}: {o['what']} ({slight}{errors})")
    for name, outcome in outcomes.items():
        if outcome["status"] != DONE:
            say(console, f"not diagnosed: {name}: {outcome['message']}")
    say(console, f"report: {report}")
    return 0 if any(o["status"] == DONE for o in outcomes.values()) else 2
