"""`estimate` of every recording for itself, and what all of them say together."""

from __future__ import annotations

import csv
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.results import plain
from haptic_teleop_sysid.runs.estimation_doubts import doubts
from haptic_teleop_sysid.runs.estimation_run import Choices, load, run_estimate, write_results
from haptic_teleop_sysid.runs.estimation_verdict import problems, rows_of

from .each import Job
from .folder import Found
from .kept import DONE

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


def doubted_sentence(outcomes: Mapping[str, Mapping[str, Any]]) -> str | None:
    """How many estimates say of themselves that they are not to be used, and why the first one does; None
    where none does."""
    doubted = [(name, o["doubts"][0]) for name, o in outcomes.items() if o["status"] == DONE and o["doubts"]]
    if not doubted:
        return None
    done = sum(o["status"] == DONE for o in outcomes.values())
    head = f"{len(doubted)} of {done} estimates are not to be used as they are"
    return f"{head}; {doubted[0][0]}: {doubted[0][1]}"


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
            fit = least_fit(o["fit"]) if o["status"] == DONE else ""
            table.writerow(
                [name, *("" if c is None else f"{c:.9g}" for c in cells), fit, o["status"], o["message"]]
            )
    return path


def least_fit(fit: Mapping[str, float | None]) -> str:
    """Return the least of an outcome's simulated fits by signal, %, as text; "none" where one is missing."""
    values = [v for v in fit.values() if v is not None]
    return f"{min(values):.1f}" if len(values) == len(fit) and values else "none"
