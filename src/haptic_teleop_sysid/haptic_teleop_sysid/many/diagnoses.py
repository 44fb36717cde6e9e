"""`diagnose` of every joint and every recording for itself: the jobs, and what each comes to."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from haptic_teleop_control.errors import ConfigurationError, RecordingError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.diagnosis.decision.adequacy import SLIGHT_ERROR
from haptic_teleop_sysid.diagnosis.inputs.cuts import SHORTEST_STRETCH, refuse_too_long
from haptic_teleop_sysid.diagnosis.inputs.uses import cut_behind, longest_stretch, usable_seconds
from haptic_teleop_sysid.diagnosis.report.summary import moved_words
from haptic_teleop_sysid.logs.reading import is_foreign
from haptic_teleop_sysid.logs.story import how_read
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.runs.diagnosis_run import Options, diagnose_into, load, refuse_too_many

from .each import Job
from .folder import Found

#: Share of a recording that judges what the rest of it says, where there is no other recording.
JUDGES = 1.0 / 3.0
Groups = tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
"""Paths of the recordings to learn from, to judge by and to show with."""


def refuse_twins(models: Sequence[Model]) -> None:
    """Raise ConfigurationError for two models of one joint: their results have one name."""
    joints = [model.joint for model in models]
    for joint in joints:
        if joints.count(joint) > 1:
            raise ConfigurationError(f"two models are of the joint {joint}: give one for each joint.")


def joint_jobs(models: Sequence[Model], groups: Groups, options: Options, output: Path) -> list[Job]:
    """Return one job a joint, all of them on the same recordings."""
    return [_job(m.joint, m, groups, options, output / m.joint) for m in models]


def folder_jobs(
    models: Sequence[Model], found: Sequence[Found], groups: Groups, options: Options, output: Path
) -> list[Job]:
    """Return one job a joint and recording; ``groups``: what all of them are judged by and shown with.
    Without that the last third of each recording judges it."""
    jobs = []
    for model in models:
        for f in found:
            name = f.name if len(models) == 1 else f"{model.joint}/{f.name}"
            own = ((str(f.path.resolve()),), groups[1], groups[2])
            jobs.append(_job(name, model, own, options, output / name))
    return jobs


def _job(name: str, model: Model, groups: Groups, options: Options, folder: Path) -> Job:
    whole = tuple(tuple(str(Path(bag).resolve()) for bag in group) for group in groups)
    mapped = (Path(options.mapping),) if options.mapping else ()
    recordings = tuple(Path(bag) for group in whole for bag in group) + mapped
    settings = (replace(model, source=""), whole, options)
    return Job(name, folder, recordings, diagnose_one, (model, whole, options), settings)


def diagnose_one(model: Model, groups: Groups, options: Options, folder: Path) -> dict[str, Any]:
    """Diagnose into a folder; return what the overview shows of it."""
    bags = [bag for group in groups for bag in group]
    refuse_too_long([bag for bag in bags if not is_foreign(Path(bag))], model)
    data = ([load(b, model, options.mapping) for b in group] for group in groups)
    estimation, validation, test = data
    every = [*estimation, *validation, *test]
    refuse_too_many(every)
    read = {Path(d.name).name: lines for d in every if (lines := how_read(d.experiment, d.name))}
    if not validation:
        estimation, validation = split(estimation[0])
    content, _ = diagnose_into(model, (estimation, validation, test), folder, options)
    return {"joint": model.joint, "split": not groups[1], "read": read, **overview(content)}


def split(data: DataSet) -> tuple[list[DataSet], list[DataSet]]:
    """Return a recording without its last third, and that. Raises RecordingError where they are too short."""
    first, last = cut_behind(data, JUDGES * usable_seconds(data))
    if min(longest_stretch(first), longest_stretch(last)) < SHORTEST_STRETCH:
        least = SHORTEST_STRETCH / JUDGES * data.dt
        raise RecordingError(
            f"{data.name} is too short to learn from one part and judge by another: give --validation, or "
            f"record for longer ({least:.3g} s at least)."
        )
    return [first], [last]


def overview(content: Mapping[str, Any]) -> dict[str, Any]:
    """What is wrong, in a line and in numbers: ``error``, rms over the signals of 1 - fit/100 of the given
    model, ``left`` that of the augmented one, on the recordings that were least used; ``wrong``: whether
    anything is missing or off; ``matters``: whether by so much that it is worth a word, which is a parameter
    that moved, or an error of any signal above the diagnosis' SLIGHT_ERROR."""
    fit = content["fit"]
    part = "test" if fit["given"]["test"] else "validation"
    moved = [moved_words(m) for m in content["parameters_moved"]]
    named = [f"{f['effect']} at {f['location']}" for f in content["findings"]]
    where = content["where"][0] if content["where"] else None
    if not named and content["verdict"] == "unknown":
        named = ["nothing that has a name" + (f", at {where['equation']}" if where else "")]
    worst = max(_errors(fit["given"][part]), default=math.inf)
    wrong = content["verdict"] != "no_mismatch" or bool(moved)
    words = [*named, *(f"off: {text}" for text in moved)]
    return {
        "verdict": content["verdict"],
        "wrong": wrong,
        "matters": wrong and (bool(moved) or worst > SLIGHT_ERROR),
        "what": "; ".join(words) or "nothing",
        "error": _error(fit["given"][part]),
        "left": _error(fit["augmented"][part]),
        "judged_by": part,
    }


def _error(fit: Mapping[str, float | None]) -> float | None:
    """None where a response runs away."""
    errors = _errors(fit)
    if not errors or math.inf in errors:
        return None
    return math.sqrt(sum(e**2 for e in errors) / len(errors))


def _errors(fit: Mapping[str, float | None]) -> list[float]:
    """1 - fit/100 of each signal, infinite where its response runs away."""
    return [math.inf if v is None or not math.isfinite(v) else 1.0 - v / 100.0 for v in fit.values()]
