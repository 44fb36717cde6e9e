"""The benchmark's report: what came of the targets, and where the diagnosis errs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from haptic_teleop_sysid.blind.tables import (
    WORDS,
    baseline_table,
    confusion_table,
    effect_table,
    goal,
    percent,
    rows_table,
    targets_table,
    together_table,
)
from haptic_teleop_sysid.report import Page
from haptic_teleop_sysid.report.pictures import COLOUR, blank, styled
from haptic_teleop_sysid.report.roles import ROLES

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.figure import Figure


def power_figure(cases: Sequence[dict[str, Any]]) -> Figure:
    """Return detected and rightly named shares over d'."""
    singles = [c for c in cases if c["kind"] == "single"]
    isolable = [c for c in singles if c["isolable"]]
    with styled():
        figure = blank(10.0, 2.8)
        axis = figure.subplots()
        for label, key, role, chosen in (
            ("detected", "detected", "augmented", singles),
            ("first name right,\nwhere isolable", "name_right", "given", isolable),
        ):
            ordered = sorted(chosen, key=lambda c: c["detectability"][0])
            groups = [
                g for g in np.array_split(np.arange(len(ordered)), max(1, len(ordered) // 25)) if len(g)
            ]
            x = [np.median([ordered[i]["detectability"][0] for i in g]) for g in groups]
            y = [np.mean([bool(ordered[i][key]) for i in g]) for g in groups]
            dash = (0, ROLES[role].dash) if ROLES[role].dash else "-"
            axis.plot(x, y, marker="o", color=COLOUR[role], linestyle=dash, label=label, markersize=4)
        axis.set_xscale("log")
        axis.xaxis.set_major_formatter("{x:g}")
        axis.set_xlabel("detectability d'")
        axis.set_ylabel("share of cases")
        axis.set_ylim(-0.03, 1.03)
        axis.legend(loc="upper left", bbox_to_anchor=(1.005, 1.05), borderaxespad=0.0, handlelength=2.4)
    return figure


def write_page(result: dict[str, Any], path: Path) -> Path:
    """Write the report and return its path."""
    return blind_page(result).write(path)


def blind_page(result: dict[str, Any]) -> Page:
    """Return the report of a run, as blind.json has it."""
    summary = result["summary"]
    kinds = ", ".join(f"{number} {kind}" for kind, number in result["cases_asked"].items())
    page = Page(
        "Blind benchmark of the diagnosis",
        f"cases: {kinds}; seed {result['seed']}, version {result['version']}",
    )
    _conclude(page, result)
    targets = summary["targets"]
    for key in ("false_alarms", "detected", "first_name"):
        page.key_figure(percent(targets[key]), WORDS[key], f"must {goal(key, targets[key], 'must')}")
    section = page.section("Targets", "Effects of detectability d' ≥ 8, as an ideal observer would see them.")
    section.table(*targets_table(result))
    if summary["failed"]:
        page.section("Failures of the command").table(("case",), [(line,) for line in summary["failed"]])
    if summary["confusion"]:
        _mistakes(page, summary)
    section = page.section("By size")
    section.table(*rows_table(summary["by_size"], "size"))
    if any(case["kind"] == "single" for case in result["cases"]):
        section.picture(power_figure(result["cases"]), "Share detected and rightly named over d'")
    page.section("By effect and size", "First name right of isolable cases; in brackets detected.").table(
        *effect_table(result)
    )
    page.section("By loop and stage").table(
        *rows_table({**summary["by_loop"], **summary["by_stage"]}, "experiment")
    )
    clean = summary["clean"]
    page.section("Clean recordings").table(
        ("recordings", "false alarms"),
        [(name.replace("_", " "), percent(clean[name])) for name in ("all", "without_trace", "with_trace")],
        f"A trace of d' below 1 was rightly named {clean['trace_named']} times, which counts as no alarm.",
    )
    if (several := together_table(summary))[1]:
        page.section("Several effects together").table(*several)
    page.section("Outside the table").table(
        ("physics", "called unknown"), [(k, percent(v)) for k, v in summary["outside_by_effect"].items()]
    )
    calibration = summary["calibration"]
    page.section("Calibration", _calibration_sentence(calibration)).table(
        ("stated from", "to", "cases", "mean stated", "right"),
        [
            (f"{r['from']:g}", f"{r['to']:g}", r["cases"], f"{r['stated']:.3f}", f"{r['right']:.3f}")
            for r in calibration["rows"]
        ],
    )
    if result.get("baselines"):
        page.section("What people would otherwise do").table(*baseline_table(result))
    return page


def _conclude(page: Page, result: dict[str, Any]) -> None:
    """The first line: how many targets are met, or which are not, or that diagnoses failed; and the seal."""
    summary, targets = result["summary"], result["summary"]["targets"]
    words = ("aim", "must", "missed", "no data")
    met = {word: [WORDS[k] for k, entry in targets.items() if entry["met"] == word] for word in words}
    judged, ran = len(targets) - len(met["no data"]), result["cases_run"]
    all_met = f"all {judged} targets{' that there are data for' if met['no data'] else ''} are met"
    failed = len(summary["failed"])
    if met["missed"]:
        told = f"{len(met['missed'])} of {judged} targets missed: {'; '.join(met['missed'])}."
        page.conclude("bad", told, "see below what was said instead, and the reports of those cases.")
    elif failed:
        told = f"{failed} of {ran} diagnoses failed, which counts as wrong; even so {all_met}."
        page.conclude("bad", told, "see below with which message.")
    elif judged:
        further = f"; {len(met['aim'])} of them reach what is aimed at" if met["aim"] else ""
        page.conclude("good", f"{all_met.capitalize()}{further}.")
    else:
        page.conclude("fair", "No target can be judged: these cases say nothing of any.")
    if failed and met["missed"]:
        page.verdict("bad", f"{failed} of {ran} diagnoses failed, which counts as wrong.")
    if met["no data"]:
        page.verdict("plain", f"No data for: {'; '.join(met['no data'])}.")
    if ran < (asked := sum(result["cases_asked"].values())):
        page.verdict("fair", f"Only {ran} of {asked} cases have run, in an order drawn beforehand.")
    page.verdict("plain", f"Labels sealed before the first diagnosis: SHA-256 {result['digest']}.")


def _mistakes(page: Page, summary: dict[str, Any]) -> None:
    confusion = summary["confusion"]
    outside = {name.partition(" @ ")[0] for name in summary["outside_by_effect"]}
    header, rows = confusion_table(confusion, outside)
    always = len(confusion) - len(rows)
    section = page.section(
        "What was said instead",
        f"{always} of {len(confusion)} kinds of hidden physics were always said first as what they are "
        "(physics without a name: as unknown; nothing hidden: as no mismatch).",
    )
    if rows:
        section.table(header, rows, "The others, the most often mistaken first")


def _calibration_sentence(found: dict[str, Any]) -> str:
    if found["ece"] is None:
        return "No names to compare with their confidence."
    low, high = found["interval"]
    return (
        "Is the first name, place included, right as often as its confidence says? Over "
        f"{found['cases']} names the expected calibration error is {found['ece']:.3f}; by chance alone it "
        f"would be {found['by_chance']:.3f}. The difference is {found['debiased']:.3f} (95 %: {low:.3f} to "
        f"{high:.3f})."
    )
