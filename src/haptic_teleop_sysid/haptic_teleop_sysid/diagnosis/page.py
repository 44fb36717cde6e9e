"""The report of a diagnosis: one page that one would show to a colleague."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from haptic_teleop_sysid.dataset import DataSet
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.parameter_units import Units
from haptic_teleop_sysid.report import Page, Panel, Series, stacked_panels
from haptic_teleop_sysid.report.pictures import STYLE

from . import page_columns
from .decide import SURE
from .page_map import map_section
from .proof import MODELS, PARTS, Proof
from .residual import Condition, left_over
from .search import SearchResult
from .summary import LIMIT, PART_LABELS, percent
from .testimony import testimony_section
from .verdict import Verdict
from .words import chance_sentence

_HEADLINE = {
    "identified": ("good", "The missing physics has a name: {names}."),
    "ambiguous": ("fair", "These recordings cannot tell {names} apart: see the next experiment."),
    "unknown": ("fair", "Something is missing that no known effect explains; it sits at {where}."),
    "no_mismatch": (
        "good",
        "The given structure, re-estimated, explains these recordings; nothing is missing that they "
        "could show.",
    ),
}


def diagnosis_page(
    result: SearchResult,
    verdict: Verdict,
    content: dict[str, Any],
    proof: Proof,
    estimation: Sequence[Record],
    units: Units,
) -> Page:
    """The page of one diagnosis; ``estimation``: what was fitted to; ``units`` of the machine."""
    verdict = replace(verdict, findings=units.restated_all(verdict.findings))
    force = units.force.replace("*", "·")
    model = result.baseline.model
    count = sum(len(proof.parts[part]) for part in PARTS)
    page = Page(f"Diagnosis of {model.robot} {model.joint}", f"{model.structure}; {count} recordings")
    page_columns.first_sentences(page, content)
    status, headline = _HEADLINE[verdict.kind]
    page.verdict(status, headline.format(names=_names(verdict), where=_where(verdict)))  # type: ignore[arg-type]
    for f in verdict.findings:
        page.key_figure(f"{100 * f['confidence']:.0f} %", f"{f['effect']} at {f['location']}", "confidence")
    page_columns.explains(page, content)
    page_columns.moved(page, content)
    page_columns.key_figures(page, content)
    _findings(page, verdict, content)
    page_columns.fits(page, content)
    page_columns.parameters(page, content)
    map_section(page, content, units)
    testimony_section(page, content)
    section = page.section(
        "Where it sits",
        "Torque that the observer had to add to follow the first recording: with the "
        "given structure, and with what was found.",
    )
    section.picture(_left_over_picture(result, estimation[0], force), "left-over torque before and after")
    curves = [c for c in verdict.before[:3] if len(c.centre)]
    if curves:
        section.picture(
            _curves(curves, verdict.remaining, units), "left-over torque against what it follows best"
        )
        section.table(
            ("equation", "depends on", "explained before", "explained after"),
            [
                (
                    c.equation,
                    c.name,
                    f"{100 * max(c.explained, 0):.0f} %",
                    f"{100 * max(_after(c, verdict), 0):.0f} %",
                )
                for c in verdict.before[:6]
            ],
            "share of the left-over torque that a curve explains on recordings it was not drawn from",
        )
    for part in PARTS:
        for number, dataset in enumerate(proof.parts[part]):
            page.section(f"{dataset.name} ({part}: {PART_LABELS[part]})").picture(
                _response(dataset, proof, part, number), "measured and simulated"
            )
    _tried(page, result)
    problems = [(name, p) for name, told in content["recordings"].items() for p in told]
    if problems:
        page.section("What is wrong with the recordings").table(("recording", "problem"), problems)
    return page


def _names(verdict: Verdict) -> str:
    if verdict.kind == "ambiguous":
        unsure = [f for f in verdict.findings if sum(a["confidence"] for a in f["alternatives"]) > 1.0 - SURE]
        names = [n for f in unsure for n in (f, *f["alternatives"])]
        return " or ".join(dict.fromkeys(f"{n['effect']} at {n['location']}" for n in names))
    return " and ".join(f"{f['effect']} at {f['location']}" for f in verdict.findings)


def _where(verdict: Verdict) -> str:
    return (
        ", ".join(f"{w['equation']} and depends on {w['condition']}" for w in verdict.where)
        or "no single place"
    )


def _findings(page: Page, verdict: Verdict, content: dict[str, Any]) -> None:
    section = page.section("What was found")
    for f in verdict.findings:
        section.text(f["because"])
        section.table(
            ("parameter", "value", "standard error", "unit"),
            [(n, _value(p), f"{p['std']:.2g}", p["unit"]) for n, p in f["parameters"].items()],
            f"{f['effect']} at {f['location']}",
        )
        if f["alternatives"]:
            section.table(
                ("other explanation", "at", "confidence"),
                [(a["effect"], a["location"], f"{100 * a['confidence']:.0f} %") for a in f["alternatives"]],
            )
    if not verdict.findings:
        section.text(_HEADLINE[verdict.kind][1].format(names="", where=_where(verdict)))
    if "doubt" in content:
        section.text(f"Why no name is given: {content['doubt']}.")
    if "beside" in content:
        section.text(f"Beside what is named, {content['beside']}.")
    if "nulls" in content:
        section.text(f"By chance alone: {chance_sentence(content['nulls'])}.")
    experiment = content["next_experiment"]
    section.text(f"Next experiment: {experiment['why']}.")
    if experiment["signal_generator"]:
        section.table(
            ("parameter of acquire", "setting"),
            sorted(experiment["signal_generator"].items()),
            f"expected to tell them apart with probability {experiment['expected_discrimination']:.2f}",
        )


def _value(p: dict[str, Any]) -> str:
    return f"{p['value']:.5g}" + (f" ({LIMIT[p['at_bound']]})" if "at_bound" in p else "")


def _left_over_picture(result: SearchResult, record: Record, force: str) -> Figure:
    before, after = left_over(result.baseline, record), left_over(result.final, record)
    panels = []
    for channel, name in enumerate(("motor",) if result.baseline.model.rigid else ("motor", "arm")):
        lines = [Series("given structure", before.time, before.torque[:, channel], colour=2)]
        if result.choices:
            lines.append(Series("with what was found", after.time, after.torque[:, channel], colour=1))
        panels.append(Panel(f"left-over torque at the {name}", force, lines))
    return stacked_panels(panels, x_label="time (s)")


def _after(condition: Condition, verdict: Verdict) -> float:
    return next(
        (
            c.explained
            for c in verdict.remaining
            if (c.equation, c.name) == (condition.equation, condition.name)
        ),
        0.0,
    )


def _curves(curves: Sequence[Condition], remaining: Sequence[Condition], units: Units) -> Figure:
    with rc_context(STYLE):
        figure = Figure(figsize=(8.6, 2.6), layout="constrained")
        panels = list(figure.subplots(1, len(curves), squeeze=False)[0])
        for axes, c in zip(panels, curves, strict=True):
            axes.plot(c.centre, c.torque, "o-", color="#c2570d", markersize=3, label="given structure")
            for r in remaining:
                if (r.equation, r.name) == (c.equation, c.name) and r is not c:
                    axes.plot(
                        r.centre, r.torque, "o-", color="#2166ad", markersize=3, label="with what was found"
                    )
            axes.set_title(c.equation)
            axes.set_xlabel(f"{c.name} ({units.restated(c.unit)})")
        panels[0].set_ylabel(f"left-over torque ({units.force.replace('*', '·')})")
        panels[0].legend()
    return figure


def _response(dataset: DataSet, proof: Proof, part: str, number: int) -> Figure:
    panels = []
    for signal, measured in dataset.signals().items():
        lines = [Series("measured", dataset.time, measured, colour=0, width=1.8)]
        for model, label, colour in zip(MODELS, page_columns.HEADS, (3, 2, 1), strict=True):
            fit = proof.fits[model][part][number]
            low, high = float(np.min(measured)), float(np.max(measured))
            room = 0.6 * (high - low)
            lines.append(
                Series(
                    f"{label}  {percent(fit.percent[signal])} %",
                    dataset.time,
                    np.clip(fit.simulated[signal], low - room, high + room),
                    colour=colour,
                )
            )
        panels.append(Panel(signal, dataset.units()[signal], lines))
    return stacked_panels(panels, x_label="time (s)")


def _tried(page: Page, result: SearchResult) -> None:
    rows = [
        (
            e.effect.effect,
            e.effect.location,
            f"{e.gain:.0f}",
            f"{e.elsewhere:.0f}",
            "yes" if e.material else "no",
        )
        for e in result.last_round[:10]
    ]
    if rows:
        page.section(
            "What else was tried", "Further effects that did not stand up in the last round of the search."
        ).table(("effect", "at", "gain (nats)", "on validation recordings", "large enough to matter"), rows)
