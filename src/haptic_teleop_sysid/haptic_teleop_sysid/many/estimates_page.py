"""Estimates of every recording for itself, and what all of them say together, as a page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

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

from .estimates import doubted_sentence, least_fit, together
from .kept import DONE, numbers


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
                    least_fit(o["fit"]),
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


def _headed(name: str, unit: str) -> str:
    return f"{name} ({unit_text(unit)})" if unit not in ("", "1") else name


def _cell(row: Mapping[str, Any] | None) -> str:
    if row is None or row["value"] is None:
        return "not determined"
    told = with_error(row["value"], row["std"], relative_to=row.get("relative_to"))
    return told.replace("±", "± at least") if row.get("at_least") else told
