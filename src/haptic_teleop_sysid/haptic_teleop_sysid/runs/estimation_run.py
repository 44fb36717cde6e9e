"""Estimates from the names of recordings: read, treat, estimate, judge, write what was found."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_control.recording import Recording
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.excitation import at_values, refuse_idle
from haptic_teleop_sysid.estimation.kept_starts import with_starts_kept
from haptic_teleop_sysid.estimation.progress import Progress, silent
from haptic_teleop_sysid.estimation.records import records_from, with_trusted_input
from haptic_teleop_sysid.estimation.residuals import residual_analysis, tuned_to
from haptic_teleop_sysid.estimation.strategies import METHODS, estimate
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.story import how_read, reported
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.recordings.preparation import (
    MOST_SAMPLES,
    Treatment,
    prepare,
    refuse_huge,
    with_damage_told,
)
from haptic_teleop_sysid.report import save_png
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.estimation_doubts import doubts
from haptic_teleop_sysid.runs.estimation_report import as_json, fit_picture, page
from haptic_teleop_sysid.runs.estimation_result import Result
from haptic_teleop_sysid.runs.estimation_verdict import Commands, problems
from haptic_teleop_sysid.runs.form_errors import with_forms
from haptic_teleop_sysid.runs.shape_starts import shape_starts
from haptic_teleop_sysid.runs.told_roles import role_comment
from haptic_teleop_sysid.runs.undetermined import undetermined_sentence
from haptic_teleop_sysid.simulation.fit import choose_windows, simulated_fit


@dataclass(frozen=True)
class Choices:
    """How recordings are treated and estimated from: the options of `estimate`, with its defaults."""

    method: str = "prediction-error"
    at_rest: bool = False
    multi_start: int = 1
    seed: int = 1
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    treatment: Treatment = field(default_factory=Treatment)
    allow_gaps: bool = False
    mapping: str | None = None


def load_one(bag: str, model: Model, choices: Choices) -> tuple[Recording, DataSet, list[str]]:
    """Read, check and treat a recording, or a log by a mapping; also what was done to it.

    Raises RecordingError or MismatchError in one sentence for what cannot be estimated from.
    """
    refuse_huge(bag)
    recording = open_recording(bag, choices.mapping)
    with reported({bag: recording.problems}):
        dataset = with_damage_told(load_dataset(recording, model, bag, choices.allow_gaps), recording)
        refuse_idle(dataset)
        treated, told = prepare(dataset, recording, model, choices.treatment)
        refuse_idle(treated)
    return recording, with_trusted_input(treated), [*how_read(recording.experiment, bag), *told]


def load(
    bags: Sequence[str], model: Model, choices: Choices
) -> tuple[dict[str, DataSet], dict[str, list[str]]]:
    """As `load_one`: data sets by bag, and what was done to each."""
    data: dict[str, DataSet] = {}
    told: dict[str, list[str]] = {}
    for bag in bags:
        _, data[bag], told[bag] = load_one(bag, model, choices)
    return data, told


def run_estimate(
    model: Model,
    data: dict[str, DataSet],
    told: dict[str, list[str]],
    validation: Sequence[str] = (),
    choices: Choices | None = None,
    progress: Progress = silent,
) -> Result:
    """Estimate from the data sets that `validation` does not name, and judge the result on all of them."""
    choices = choices or Choices()
    used = [d for bag, d in data.items() if bag not in validation]
    if sum(len(d) for d in used) > MOST_SAMPLES:
        raise RecordingError(
            f"{', '.join(d.name for d in used)}: {sum(len(d) for d in used)} samples are more than the "
            f"{MOST_SAMPLES} that one estimate takes: choose a part with --range, or a lower --rate."
        )
    records = [piece for d in used for piece in records_from(with_trusted_input(d), choices.at_rest)]
    one_step = choices.method == METHODS[0]
    found = estimate(
        model,
        used,
        choices.method,
        at_rest=choices.at_rest,
        multi_start=choices.multi_start,
        seed=choices.seed,
        limits=choices.limits,
        cross_check=True,
        starts=shape_starts(model, records, choices.limits) if one_step else (),
        progress=progress,
    )
    found = with_forms(with_starts_kept(found, records, choices.limits), records)
    progress("simulating", 1.0)
    fits, residuals = {}, {}
    for bag, dataset in data.items():
        windows = choose_windows(found.model, dataset)
        fits["start", bag] = simulated_fit(found.start, dataset, windows)
        fits["estimate", bag] = simulated_fit(found.model, dataset, windows)
        record = max(records_from(dataset), key=len)
        # Residuals are those of one step, whichever predictor gave the numbers; on other recordings with
        # their own noise levels: an observer that hardly corrects is slow to find how a joint began.
        basis = found.fit if found.fit and not found.misled else at_values(found.model, [record])
        if bag in validation and basis is found.fit:
            basis = tuned_to(basis, record)
        if math.isfinite(basis.log_likelihood):
            residuals[bag] = residual_analysis(basis, record)
    return Result(found, data, tuple(validation), fits, residuals, told)


def save_model(result: Result, path: Path) -> None:
    """Write the estimated model, with a line of comment on each parameter that is not determined, and on what
    speaks against the others."""
    found = result.estimate
    undetermined = () if found.uncertainty is None else found.uncertainty.undetermined
    comments = [undetermined_sentence(found, name) for name in undetermined]
    against = [*(one.headline for one in problems(result)), *(one.sentence for one in doubts(result))]
    replace(found.model, source="estimate").save(path, [role_comment("baseline"), *against, *comments])


def write_results(
    result: Result,
    output: Path,
    began: float,
    with_page: bool = True,
    commands: Commands | None = None,
) -> Path | None:
    """Write model.yaml and estimate.json, and with ``with_page`` report.html, whose path is returned, and
    its pictures. ``began``: `time.perf_counter` when it began; ``commands``: what the page gives to paste."""
    save_model(result, output / "model.yaml")
    path = None
    if with_page:
        for number, bag in enumerate(result.data, start=1):
            save_png(fit_picture(result, bag), output / ("fit.png" if number == 1 else f"fit-{number}.png"))
        path = page(result, commands).write(output / "report.html")
    content = as_json(result) | {"runtime_s": time.perf_counter() - began, "version": tool_version()}
    write_json(output / "estimate.json", content)
    return path
