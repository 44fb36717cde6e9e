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

from haptic_teleop_control.command_line import run_command
from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sim.model import Model, load_model
from haptic_teleop_sysid.dataset import DataSet, load_dataset
from haptic_teleop_sysid.diagnosis.beside_given import handed_on
from haptic_teleop_sysid.diagnosis.cuts import MOST_SAMPLES, refuse_too_long, with_cuts_told
from haptic_teleop_sysid.diagnosis.diagnose import diagnose, records_of
from haptic_teleop_sysid.diagnosis.forecast import DiagnosisForecast, pass_seconds
from haptic_teleop_sysid.diagnosis.next_experiment import write_acquire_file
from haptic_teleop_sysid.diagnosis.page import diagnosis_page
from haptic_teleop_sysid.diagnosis.plausible import refuse_implausible, with_contradictions
from haptic_teleop_sysid.diagnosis.summary import summary
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.reading import is_foreign
from haptic_teleop_sysid.parameter_units import Units
from haptic_teleop_sysid.preparation import with_damage_told
from haptic_teleop_sysid.report import claim_output_directory
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.run_progress import RunProgress
from haptic_teleop_sysid.treatment_options import add_mapping_option

MOST_NULLS = 1000


def run(argv: list[str]) -> int:
    """Do what the arguments say; returns the exit status."""
    began = time.perf_counter()
    arguments = _parser().parse_args(argv)
    refuse_repeated([*arguments.estimation, *arguments.validation, *arguments.test])
    model = replace(load_model(arguments.model), source=arguments.model)
    bags = [*arguments.estimation, *arguments.validation, *arguments.test]
    refuse_too_long([bag for bag in bags if not is_foreign(Path(bag))], model)
    console, screen = Console(), Console(stderr=True)
    output = claim_output_directory(arguments.output, "diagnosis.json", arguments.overwrite)
    forecast = DiagnosisForecast(arguments.nulls, os.cpu_count() or 1)
    with RunProgress(screen, "diagnose", forecast) as progress:
        progress.say("reading recordings")
        estimation, validation, test = (
            [_load(bag, model, arguments.mapping) for bag in group]
            for group in (arguments.estimation, arguments.validation, arguments.test)
        )
        _refuse_too_many([*estimation, *validation, *test])
        forecast.unit = pass_seconds(model, records_of(estimation))
        result, verdict, proof, content = diagnose(
            model, estimation, validation, progress.say, arguments.nulls, test
        )
        progress.say("writing the report")
        units = Units.of(model, estimation[0])
        content = units.restated_all(content)
        content |= {"runtime_s": round(time.perf_counter() - began, 2), "version": tool_version()}
        write_json(output / "diagnosis.json", content)
        replace(handed_on(proof)[1], source=str(output / "augmented_model.yaml")).save(
            output / "augmented_model.yaml"
        )
        write_acquire_file(output, model, content["next_experiment"])
        report = None
        if not arguments.no_report:
            page = diagnosis_page(result, verdict, content, proof, records_of(estimation), units)
            report = page.write(output / "report.html")
    for name, problems in content["recordings"].items():
        for problem in problems:
            screen.print(f"note: {name}: {problem}", markup=False, highlight=False)
    console.print(summary(content), markup=False, highlight=False, soft_wrap=True)
    if report is not None:
        console.print(f"report: {report}", markup=False, highlight=False, soft_wrap=True)
    return 0


def refuse_repeated(bags: list[str]) -> None:
    """Raise ConfigurationError for a recording that is given twice: what was fitted to, or chose, proves
    nothing of other recordings."""
    places = [Path(bag).resolve() for bag in bags]
    for bag, place in zip(bags, places, strict=True):
        if places.count(place) > 1:
            raise ConfigurationError(
                f"{bag} is given twice: learn from, judge by and show with different recordings."
            )


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) > MOST_NULLS:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to {MOST_NULLS}")
    return int(text)


def _refuse_too_many(data: list[DataSet]) -> None:
    """As `refuse_too_long`, for logs, whose length shows when they are read."""
    if (samples := sum(len(d) for d in data)) > MOST_SAMPLES:
        raise RecordingError(
            f"the recordings hold {samples} samples, and a diagnosis keeps at most {MOST_SAMPLES} in memory: "
            "a few minutes say as much; import a part of the longest with `import --rows FIRST LAST`."
        )


def _load(bag: str, model: Model, mapping: str | None = None) -> DataSet:
    recording = open_recording(bag, mapping)
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
        "--test",
        nargs="+",
        default=[],
        metavar="BAG",
        help="recordings that show and do nothing else: how the models fit what they were neither fitted to "
        "nor chosen by (without them, the last third of the validation from 60 s on)",
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
    add_mapping_option(parser)
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
