"""`estimate` of every recording for itself, and what all of them say together."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from haptic_teleop_control.counted import counted
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.report import (
    Link,
    Page,
    Panel,
    Plot,
    Series,
    error_text,
    rounded,
    unit_text,
    with_error,
)
from haptic_teleop_sysid.results import plain
from haptic_teleop_sysid.runs.estimation_doubts import doubts
from haptic_teleop_sysid.runs.estimation_run import Choices, load, run_estimate, write_results
from haptic_teleop_sysid.runs.estimation_verdict import problems, rows_of

from .each import Job
from .folder import Found
from .kept import DONE, numbers

#: Probability below which scatter is not what the standard errors say.
_UNLIKELY = 0.01


def estimate_jobs(
    found: Sequence[Found],
    model: Model,
    validation: Sequence[str],
    choices: Choices,
    with_page: bool,
    output: Path,
) -> list[Job]:
    """Return one job a recording; each writes what `estimate` writes into a folder of its own."""
    others = tuple(str(Path(bag).resolve()) for bag in validation)
    known = tuple(Path(bag) for bag in (*others, *([choices.mapping] if choices.mapping else ())))
    return [
        Job(
            f.name,
            output / f.name,
            (f.path, *known),
            estimate_one,
            (str(f.path.resolve()), model, others, choices, with_page),
            (replace(model, source=""), choices, with_page),
        )
        for f in found
    ]


def estimate_one(
    bag: str, model: Model, validation: Sequence[str], choices: Choices, with_page: bool, folder: Path
) -> dict[str, Any]:
    """Estimate from one recording into its folder; return what the table shows of it."""
    began = time.perf_counter()
    data, told = load([bag, *validation], model, choices)
    result = run_estimate(model, data, told, validation, choices)
    write_results(result, folder, began, with_page)
    shown = validation or [bag]
    return plain(
        {
            "parameters": {
                row.name: {
                    "value": row.value,
                    "std": row.std,
                    "unit": row.unit,
                    "at_least": row.at_least,
                    "relative_to": row.relative_to,
                }
                for row in rows_of(result)
                if row.status != "fixed"
            },
            "converged": result.estimate.converged,
            "fit": {
                signal: min(result.fits["estimate", b].percent[signal] for b in shown)
                for signal in data[bag].signals()
            },
            "doubts": [
                *(problem.headline for problem in problems(result)),
                *(doubt.sentence for doubt in doubts(result)),
            ],
        }
    )


def together(outcomes: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return by parameter the ``mean`` over the recordings weighted by their standard errors, its ``std``,
    ``count``, ``scatter`` (chi-square per degree of freedom: one where recordings differ by as much as their
    errors say) and ``alike``: False where chance does not explain it."""
    found: dict[str, dict[str, Any]] = {}
    done = [o for o in outcomes.values() if o["status"] == DONE and o["converged"]]
    for name in done[0]["parameters"] if done else ():
        rows = [o["parameters"][name] for o in done]
        known = [(r["value"], r["std"]) for r in rows if r["value"] is not None and r["std"]]
        if not known:
            continue
        values, std = np.array(known).T
        weight = 1.0 / std**2
        mean = float(np.sum(weight * values) / np.sum(weight))
        total = float(np.sum(weight * (values - mean) ** 2))
        free = len(values) - 1
        found[name] = {
            "mean": mean,
            "std": float(np.sqrt(max(total / free if free else 1.0, 1.0) / np.sum(weight))),
            "unit": rows[0]["unit"],
            "count": len(values),
            "scatter": total / free if free else None,
            "alike": not free or float(scipy.special.chdtrc(free, total)) > _UNLIKELY,
        }
    return found


def estimates_page(model: Model, outcomes: Mapping[str, Mapping[str, Any]], with_page: bool) -> Page:
    """Return the overview: what the recordings say together, and each for itself."""
    subtitle = f"{model.robot} {model.joint}, {counted(len(outcomes), 'recording')}"
    page = Page("Estimates of many recordings", subtitle)
    all_, unusable = (
        together(outcomes),
        [(n, o["message"]) for n, o in outcomes.items() if o["status"] != DONE],
    )
    different = [name for name, row in all_.items() if not row["alike"]]
    if (doubted := doubted_sentence(outcomes)) is not None:
        page.verdict("bad", doubted)
    if different:
        page.verdict(
            "fair",
            f"{', '.join(different)} differ from recording to recording by more than their errors: put them "
            "in order of time with `trend`, or find what differs between the recordings.",
        )
    elif all_:
        status = "good" if doubted is None else "plain"
        page.verdict(status, "The recordings agree with each other within their standard errors.")
    if unusable:
        page.verdict("fair", f"{counted(len(unusable), 'recording')} could not be used, see below.")
    page.section("Together").table(
        ("parameter", "unit", "weighted mean", "std. error", "recordings", "scatter / errors"),
        [
            (
                name,
                unit_text(row["unit"]),
                rounded(row["mean"], row["std"]),
                error_text(row["std"]),
                row["count"],
                "–" if row["scatter"] is None else f"{math.sqrt(row['scatter']):.2f}",
            )
            for name, row in all_.items()
        ],
        "The error of the mean is that of the scatter where this is larger; 1 at the end is as expected",
    )
    done = {n: o for n, o in outcomes.items() if o["status"] == DONE}
    if done:
        first = next(iter(done.values()))
        names = list(first["parameters"])
        section = page.section("Each for itself")
        if len(done) > 1 and all_:
            section.plot(
                estimates_plot(done, all_),
                "Each parameter with its standard error, in the order of the recordings; dotted: the "
                "weighted mean",
            )
        section.table(
            ("recording", *(_headed(name, first["parameters"][name]["unit"]) for name in names), "least fit"),
            [
                (
                    Link(n, f"{n}/report.html") if with_page else n,
                    *(_cell(o["parameters"].get(name)) for name in names),
                    _least(o["fit"]),
                )
                for n, o in done.items()
            ],
            "value ± standard error; least simulated fit of all signals, percent",
        )
        doubts = [(n, " ".join(o["doubts"])) for n, o in done.items() if o["doubts"]]
        if doubts:
            page.section("Not to be used as they are").table(("recording", "why"), doubts)
    if unusable:
        page.section("Not used").table(("recording", "why"), unusable)
    return page


def doubted_sentence(outcomes: Mapping[str, Mapping[str, Any]]) -> str | None:
    """How many estimates say of themselves that they are not to be used, and why the first one does; None
    where none does."""
    doubted = [(name, o["doubts"][0]) for name, o in outcomes.items() if o["status"] == DONE and o["doubts"]]
    if not doubted:
        return None
    done = sum(o["status"] == DONE for o in outcomes.values())
    head = f"{len(doubted)} of {done} estimates are not to be used as they are"
    return f"{head}; {doubted[0][0]}: {doubted[0][1]}"


def estimates_plot(done: Mapping[str, Mapping[str, Any]], means: Mapping[str, Mapping[str, Any]]) -> Plot:
    """Return one panel a parameter of which there is a mean: its value in every recording."""
    x = np.arange(1.0, len(done) + 1)
    panels = []
    for name, row in means.items():
        told = [o["parameters"].get(name) or {} for o in done.values()]
        value, std = (numbers([t.get(key) for t in told]) for key in ("value", "std"))
        line = Series("value ± std. error", x, value, marks=True, line=False, error=std)
        panels.append(Panel(name, unit_text(row["unit"]), [line], guides=(row["mean"],)))
    return Plot(panels, "recording", names=list(done))


def write_estimates(outcomes: Mapping[str, Mapping[str, Any]], path: Path) -> Path:
    """Write one row a recording, CSV; those that could not be used say why."""
    done = [o for o in outcomes.values() if o["status"] == DONE]
    names = list(done[0]["parameters"]) if done else []
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(
            ["recording", *(p for n in names for p in (n, f"{n} std")), "least fit %", "status", "why"]
        )
        for name, o in outcomes.items():
            rows = [o["parameters"].get(n, {}) if o["status"] == DONE else {} for n in names]
            cells = [row.get(key) for row in rows for key in ("value", "std")]
            fit = _least(o["fit"]) if o["status"] == DONE else ""
            table.writerow(
                [name, *("" if c is None else f"{c:.9g}" for c in cells), fit, o["status"], o["message"]]
            )
    return path


def _headed(name: str, unit: str) -> str:
    return f"{name} ({unit_text(unit)})" if unit not in ("", "1") else name


def _cell(row: Mapping[str, Any] | None) -> str:
    if row is None or row["value"] is None:
        return "not determined"
    told = with_error(row["value"], row["std"], relative_to=row.get("relative_to"))
    return told.replace("±", "± at least") if row.get("at_least") else told


def _least(fit: Mapping[str, float | None]) -> str:
    values = [v for v in fit.values() if v is not None]
    return f"{min(values):.1f}" if len(values) == len(fit) and values else "none"
