"""Diagnoses side by side: ranked by what is wrong, as a page, a table and a content for other programs."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.diagnosis.decision.adequacy import SLIGHT_ERROR
from haptic_teleop_sysid.report import Link, Page, Panel, Plot, Series

from .kept import DONE

Outcomes = Mapping[str, Mapping[str, Any]]
RULE = (
    "Ranked: first where a parameter is off, or something is missing and a signal of your model's simulated "
    f"response is off by more than {100 * SLIGHT_ERROR:g} % of its spread; then what differs by less; within "
    "these by the error of your model's "
    "simulated response (relative to the motion's spread, rms over the signals) on the recordings that were "
    "used least."
)


_STATUS = ("good", "fair", "bad")


def ranked(outcomes: Outcomes) -> list[str]:
    """Return the names of the diagnoses that came to an end, the worst first."""
    done = [name for name, o in outcomes.items() if o["status"] == DONE]

    def worth(name: str) -> tuple[bool, bool, float, str]:
        o = outcomes[name]
        return not o["matters"], not o["wrong"], -(math.inf if o["error"] is None else o["error"]), name

    return sorted(done, key=worth)


def overview_sentence(outcomes: Outcomes) -> str:
    """How many are in order, and which is worst."""
    order = ranked(outcomes)
    wrong = [name for name in order if outcomes[name]["matters"]]
    slight = [name for name in order if outcomes[name]["wrong"] and name not in wrong]
    if not order:
        return "Nothing could be diagnosed."
    if not wrong and not slight:
        return f"Nothing was found missing or off in any of the {len(order)}."
    told = f"Nothing that matters is wrong with any of the {len(order)}"
    if wrong:
        told = f"Something is missing or off in {len(wrong)} of {len(order)}; first {wrong[0]}: "
        told += outcomes[wrong[0]]["what"]
    if not slight:
        return f"{told}."
    others = slight[0] if len(slight) == 1 else f"{len(slight)} {'others' if wrong else 'of them'}"
    if wrong and len(slight) == 1 and len(order) == 2:
        others = f"the other, {slight[0]},"
    most = percent(max(outcomes[name]["error"] for name in slight))
    return f"{told}; {others} {'differs' if len(slight) == 1 else 'differ'} by {most}" + (
        "." if len(slight) == 1 else " at most."
    )


def overview_content(outcomes: Outcomes) -> dict[str, Any]:
    """What overview.json says."""
    return {
        "schema": 1,
        "sentence": overview_sentence(outcomes),
        "rule": RULE,
        "ranking": [{"name": name, **_without(outcomes[name])} for name in ranked(outcomes)],
        "unusable": [{"name": n, "why": o["message"]} for n, o in outcomes.items() if o["status"] != DONE],
    }


def overview_page(title: str, outcomes: Outcomes, with_pages: bool) -> Page:
    """Return the overview; ``with_pages``: each diagnosis has a page of its own in its folder."""
    order = ranked(outcomes)
    page = Page(title, counted(len(outcomes), "diagnosis", "diagnoses"))
    worst = max((outcomes[n]["wrong"] + outcomes[n]["matters"] for n in order), default=2)
    page.conclude(
        _STATUS[worst],
        overview_sentence(outcomes),
        f"open the page of {order[0]}, which is the worst: it says what to do." if order and worst else "",
    )
    if any(outcomes[name]["split"] for name in order):
        page.verdict(
            "fair",
            "Judged by the last third of the recording that was learnt from: one of another amplitude or "
            "band, given as --validation, is a harder test.",
        )
    unusable = [(n, o["message"]) for n, o in outcomes.items() if o["status"] != DONE]
    if unusable:
        page.verdict("fair", f"{len(unusable)} could not be diagnosed; they are listed below.")
    if order:
        section = page.section("Ranking", RULE)
        section.plot(errors_plot(order, outcomes), "Error of the simulated response, worst first")
        section.table(
            ("rank", "diagnosis of", "what is wrong", "error, yours", "error, augmented", "verdict"),
            [
                (
                    number,
                    Link(name, f"{name}/report.html") if with_pages else name,
                    outcomes[name]["what"],
                    percent(outcomes[name]["error"]),
                    percent(outcomes[name]["left"]),
                    outcomes[name]["verdict"],
                )
                for number, name in enumerate(order, start=1)
            ],
        )
    if unusable:
        page.section("Not diagnosed").table(("not diagnosed", "why"), unusable)
    return page


def write_overview(outcomes: Outcomes, path: Path) -> Path:
    """Write one row a diagnosis, the worst first, CSV."""
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        table.writerow(
            ["rank", "name", "joint", "verdict", "what", "error", "error augmented", "status", "why"]
        )
        for number, name in enumerate(ranked(outcomes), start=1):
            o = outcomes[name]
            errors = ["inf" if o[key] is None else f"{o[key]:.6g}" for key in ("error", "left")]
            table.writerow([number, name, o["joint"], o["verdict"], o["what"], *errors, o["status"], ""])
        for name, o in outcomes.items():
            if o["status"] != DONE:
                table.writerow(["", name, "", "", "", "", "", o["status"], o["message"]])
    return path


def percent(error: float | None) -> str:
    """An error as it is printed."""
    return "runs away" if error is None else f"{100.0 * error:.3g} %"


def _without(outcome: Mapping[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in outcome.items() if k not in ("key", "status", "message")}


def errors_plot(order: Sequence[str], outcomes: Outcomes) -> Plot:
    """Return the errors of your and of the augmented model, %, over the rank; a gap where a response runs
    away."""
    x = np.arange(1.0, len(order) + 1)
    lines = []
    for key, label, role in (("error", "your model", "given"), ("left", "augmented", "augmented")):
        errors = [outcomes[n][key] for n in order]
        values = np.array([math.nan if e is None else 100.0 * e for e in errors])
        lines.append(Series(label, x, values, role, marks=True, line=False, square=key == "error"))
    title = "Error of the simulated response, in percent of the motion's spread"
    panel = Panel(title, "%", lines, guides=(0.0,))
    return Plot([panel], "diagnosis of, worst first", names=order)
