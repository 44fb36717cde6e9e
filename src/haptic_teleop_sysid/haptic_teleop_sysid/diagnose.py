"""`haptic-teleop diagnose`: why do simulation and recording differ? Locates the mismatch, names the physics
that was left out, models it, and shows the fit improve on recordings it has not seen.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import ConfigurationError
from haptic_teleop_control.recording import read_recording
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.dataset import DataSet, load_dataset
from haptic_teleop_sysid.diagnosis.cuts import refuse_too_long, with_cuts_told
from haptic_teleop_sysid.diagnosis.diagnose import diagnose, records_of
from haptic_teleop_sysid.diagnosis.next_experiment import write_acquire_file
from haptic_teleop_sysid.diagnosis.page import diagnosis_page
from haptic_teleop_sysid.diagnosis.plausible import refuse_implausible, with_contradictions
from haptic_teleop_sysid.diagnosis.words import chance_sentence
from haptic_teleop_sysid.preparation import with_damage_told
from haptic_teleop_sysid.report import claim_output_directory
from haptic_teleop_sysid.results import tool_version, write_json

MOST_NULLS = 1000


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    refuse_repeated([*arguments.estimation, *arguments.validation])
    model = replace(load_model(arguments.model), source=arguments.model)
    refuse_too_long([*arguments.estimation, *arguments.validation], model)
    console, progress = Console(), Console(stderr=True)
    output = claim_output_directory(arguments.output, "diagnosis.json", arguments.overwrite)
    with progress.status("reading recordings") as status:
        estimation = [_load(bag, model) for bag in arguments.estimation]
        validation = [_load(bag, model) for bag in arguments.validation]
        result, verdict, proof, content = diagnose(
            model, estimation, validation, lambda text: status.update(text), arguments.nulls
        )
        status.update("writing the report")
        content |= {"runtime_s": round(time.perf_counter() - began, 2), "version": tool_version()}
        write_json(output / "diagnosis.json", content)
        replace(result.final.model, source=str(output / "augmented_model.yaml")).save(
            output / "augmented_model.yaml"
        )
        write_acquire_file(output, model, content["next_experiment"])
        report = None
        if not arguments.no_report:
            data, records = [*estimation, *validation], records_of(estimation)
            page = diagnosis_page(result, verdict, content, proof, data, records, len(estimation))
            report = page.write(output / "report.html")
    for name, problems in content["recordings"].items():
        for problem in problems:
            progress.print(f"note: {name}: {problem}", markup=False, highlight=False)
    console.print(summary(content), markup=False, highlight=False, soft_wrap=True)
    if report is not None:
        console.print(f"report: {report}", markup=False, highlight=False, soft_wrap=True)
    return 0


def summary(content: dict[str, Any]) -> str:
    """The verdict in a few lines for the terminal."""
    lines = [f"verdict: {content['verdict']}"]
    if "doubt" in content:
        lines.append(f"  because {content['doubt']}")
    for f in content["findings"]:
        numbers = ", ".join(
            f"{n} {p['value']:.4g} ± {p['std']:.1g}" + ("" if p["unit"] == "1" else f" {p['unit']}")
            for n, p in f["parameters"].items()
        )
        lines.append(f"  {f['effect']} at {f['location']} ({100 * f['confidence']:.0f} %): {numbers}")
        lines += [
            f"    or {a['effect']} at {a['location']} ({100 * a['confidence']:.0f} %)"
            for a in f["alternatives"]
        ]
    if "beside" in content:
        lines.append(f"  beside it {content['beside']}")
    if "nulls" in content:
        lines.append(f"  {chance_sentence(content['nulls'])}")
    for part in ("estimation", "validation"):
        before, after = content["fit"]["baseline"][part], content["fit"]["augmented"][part]
        lines.append(f"  {part}: " + ", ".join(f"{n} {before[n]:.1f} -> {after[n]:.1f} %" for n in before))
    return "\n".join(lines)


def refuse_repeated(bags: list[str]) -> None:
    """Raise ConfigurationError for a recording that is given twice: what was fitted to is not unseen."""
    places = [Path(bag).resolve() for bag in bags]
    for bag, place in zip(bags, places, strict=True):
        if places.count(place) > 1:
            raise ConfigurationError(f"{bag} is given twice: learn from and judge by different recordings.")


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) > MOST_NULLS:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to {MOST_NULLS}")
    return int(text)


def _load(bag: str, model: Model) -> DataSet:
    recording = read_recording(bag)
    dataset = load_dataset(recording, model, bag, allow_gaps=True)
    refuse_implausible(model, recording, dataset)
    return with_cuts_told(with_contradictions(with_damage_told(dataset, recording)))


def main(argv: list[str] | None = None) -> int:
    """Entry point: exit status 0 when a verdict was reached, 2 for bad arguments or an unusable recording."""
    return run_command(run, argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="haptic-teleop diagnose", description=__doc__)
    parser.add_argument("--model", required=True, metavar="MODEL.yaml", help="what the lab believes")
    parser.add_argument(
        "--estimation", nargs="+", required=True, metavar="BAG", help="recordings to learn from"
    )
    parser.add_argument(
        "--validation",
        nargs="+",
        required=True,
        metavar="BAG",
        help="other recordings, of another amplitude or band, on which a finding must stand up",
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
        help="repeat the search on N simulated sets of recordings with nothing hidden (each takes as long as "
        "a diagnosis, on all cores): how often would this machine, experiment and noise raise a false alarm? "
        "A finding must exceed the best of them; 19 make a level of 5 %%",
    )
    parser.add_argument("--no-report", action="store_true", help="no page: for many diagnoses in a row")
    parser.add_argument(
        "--overwrite", action="store_true", help="replace the results of an earlier run in DIR"
    )
    parser.add_argument(
        "--allow-gaps",
        action="store_true",
        help="of older command lines: recordings are always cut apart at their holes, and that is said",
    )
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
