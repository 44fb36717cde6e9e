"""Diagnoses from the names of recordings: read, diagnose, write what was found."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.diagnosis.evidence.proof import MODELS
from haptic_teleop_sysid.diagnosis.evidence.suggested_law.entry_file import FILE
from haptic_teleop_sysid.diagnosis.inputs.cuts import MOST_SAMPLES, with_cuts_told
from haptic_teleop_sysid.diagnosis.inputs.one_run import with_one_run_told
from haptic_teleop_sysid.diagnosis.inputs.plausible import refuse_implausible, with_contradictions
from haptic_teleop_sysid.diagnosis.inputs.reversed_input import reversed_input
from haptic_teleop_sysid.diagnosis.report.beside_given import handed_on, with_numerical_held
from haptic_teleop_sysid.diagnosis.report.next_experiment import write_experiment
from haptic_teleop_sysid.diagnosis.report.page import diagnosis_page
from haptic_teleop_sysid.diagnosis.report.page_steps import Origin
from haptic_teleop_sysid.diagnosis.run import diagnose
from haptic_teleop_sysid.diagnosis.usable import records_of
from haptic_teleop_sysid.estimation.parallel import within_memory
from haptic_teleop_sysid.logs.opened import open_recording
from haptic_teleop_sysid.logs.story import reported
from haptic_teleop_sysid.recordings.dataset import DataSet, load_dataset
from haptic_teleop_sysid.recordings.parameter_units import Units
from haptic_teleop_sysid.recordings.preparation import with_damage_told
from haptic_teleop_sysid.results import tool_version, write_json
from haptic_teleop_sysid.runs.augmented_scenario import write_scenario
from haptic_teleop_sysid.runs.told_roles import role_comment


@dataclass(frozen=True)
class Options:
    """``nulls``: simulated recordings with nothing hidden; ``mapping`` of logs; ``page``: write one."""

    nulls: int = 0
    mapping: str | None = None
    page: bool = True


def load(bag: str, model: Model, mapping: str | None = None) -> DataSet:
    """Read one recording, or a log by a mapping, as a diagnosis takes it. Raises RecordingError or
    MismatchError, in a sentence, for what it cannot take."""
    recording = open_recording(bag, mapping)
    with reported({bag: recording.problems}):
        dataset = load_dataset(recording, model, bag, allow_gaps=True)
        refuse_implausible(model, recording, dataset)
    return with_cuts_told(with_contradictions(with_damage_told(dataset, recording)))


def refuse_too_many(data: Sequence[DataSet]) -> None:
    """As `refuse_too_long`, for logs, whose length shows when they are read."""
    if (samples := sum(len(d) for d in data)) > MOST_SAMPLES:
        raise RecordingError(
            f"the recordings hold {samples} samples, and a diagnosis keeps at most {MOST_SAMPLES} in memory: "
            "a few minutes say as much; take a part of the longest with `haptic-teleop import --rows FIRST "
            "LAST`."
        )


def write_suggestion(output: Path, content: dict[str, Any]) -> None:
    """Write the entry of a suggested law beside the results, where there is one; it is for the user to read
    and never run here."""
    law = (content["torque_map"] or {}).get("law")
    place = output / FILE
    place.unlink(missing_ok=True)  # of an earlier run
    if law is not None:
        place.write_text(law.pop("entry"), encoding="utf-8")


def with_input_sign(content: dict[str, Any], data: Sequence[DataSet]) -> dict[str, Any]:
    """The content of a diagnosis, whose doubt is an input that seems to have the opposite sign, where it does
    and nothing speaks for the sign: a name that is more likely than not, alone or with what it is not told
    from, in a model that follows the motion. The mismatch is then of another kind than what the recordings
    were asked for."""
    likely = any(
        f["confidence"] + sum(a["confidence"] for a in f["alternatives"]) >= 0.5 for f in content["findings"]
    )
    fits = [p for model in MODELS for p in content["fit"][model]["estimation"].values()]
    right = likely and any(p > 0.0 for p in fits)
    backwards = reversed_input(data) if content["verdict"] == "unknown" and not right else None
    if backwards is None:
        return content
    return content | {"input_sign": asdict(backwards), "doubt": backwards.sentence}


def comments(content: dict[str, Any]) -> list[str]:
    """What stands above the model that is handed on, so that it says what it is wherever it goes."""
    held = content["augmented_model"]
    told = [f"from a diagnosis with the verdict {content['verdict']}: {held['what']}"]
    if content["stand_in"] is not None and held["holds"] == "augmented":
        told.append(content["stand_in"]["what"])
    return [*told, role_comment(held["holds"])]


def diagnose_into(
    model: Model,
    recordings: tuple[list[DataSet], list[DataSet], list[DataSet]],
    output: Path,
    options: Options,
    began: float | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> tuple[dict[str, Any], Path | None]:
    """Diagnose ``recordings`` (estimation, validation, test), write the results into ``output``, and return
    the content of diagnosis.json and the page's path. ``began``: `time.perf_counter` when it began."""
    began = time.perf_counter() if began is None else began
    estimation, validation, test = parts = with_one_run_told(*recordings)
    told = reported({d.name: d.problems for part in parts for d in part})
    with told, within_memory(max(len(d) for part in parts for d in part)):
        result, verdict, proof, content = diagnose(model, estimation, validation, say, options.nulls, test)
    content = with_input_sign(content, [*estimation, *validation])
    say("writing the report")
    units = Units.of(model, estimation[0])
    write_suggestion(output, content)
    content = units.restated_all(content)
    content |= {"runtime_s": round(time.perf_counter() - began, 2), "version": tool_version()}
    write_json(output / "diagnosis.json", content)
    place = output / "augmented_model.yaml"
    handed = replace(with_numerical_held(handed_on(proof)[1]), source=str(place))
    handed.save(place, comments(content))
    scenario = write_scenario(output, handed, place.name)
    write_experiment(output, model, content["next_experiment"], estimation[0].input_unit)
    if not options.page:
        return content, None
    learn, choose, judge = (
        tuple(d.name for d in data) for data in (estimation, validation, test or validation or estimation)
    )
    judged = proof.fits["baseline"][proof.best_part]
    windows = tuple(fit.windows.seconds for fit in judged)
    origin = Origin(
        model.source, learn, choose, judge, output, options.mapping, bool(test), scenario, windows
    )
    page = diagnosis_page(result, verdict, content, proof, records_of(estimation), units, origin)
    return content, page.write(output / "report.html")
