"""The benchmark's report: one page with tables and pictures, and the tables once more as Markdown for the
docs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from haptic_teleop_sysid.report import Page
from haptic_teleop_sysid.report.pictures import blank, styled

if TYPE_CHECKING:  # importing matplotlib takes half a second
    from matplotlib.figure import Figure

WORDS = {
    "false_alarms": "false alarms on clean recordings",
    "detected": "effects detected",
    "location": "location right, of those detected",
    "first_name": "first name right, where isolable",
    "in_set": "truth in the stated set, of those named",
    "set_size": "mean size of the stated set",
    "cannot_tell": "planted ties called `ambiguous`",
    "wrongly_ambiguous": "isolable effects called `ambiguous`",
    "outside_unknown": "effects outside the table called unknown",
    "pair_both": "both effects of a pair named",
    "size_error": "error of the size, median",
    "coverage": "90 % intervals that hold the truth",
    "gap_closed": "share of the recoverable held-out gap closed, median",
    "no_harm": "held-out fit not more than 2 % worse",
}
Table = tuple[tuple[str, ...], list[tuple[str, ...]]]


def percent(entry: dict[str, Any] | None) -> str:
    """Write a rate with its count, or a value; a dash where there is no data."""
    if not entry or entry.get("rate", entry.get("value")) is None:
        return "–"
    if "hits" in entry:
        return f"{100 * entry['rate']:.0f} % ({entry['hits']}/{entry['of']})"
    return f"{100 * entry['value']:.1f} %"


def _value(key: str, entry: dict[str, Any]) -> str:
    if key == "set_size":
        return "–" if entry["value"] is None else f"{entry['value']:.2f}"
    return percent(entry)


def _goal(key: str, entry: dict[str, Any], which: str) -> str:
    if entry["sense"] == "within":
        return "80–97 %" if which == "must" else "86–94 %"
    sign = "≥" if entry["sense"] == "at least" else "≤"
    return f"{sign} {entry[which]:g}" if key == "set_size" else f"{sign} {100 * entry[which]:g} %"


def targets_table(result: dict[str, Any]) -> Table:
    """Return the targets of the issue with what was measured."""
    rows = []
    for key, entry in result["summary"]["targets"].items():
        interval = entry.get("interval")
        shown = f"{100 * interval[0]:.1f}–{100 * interval[1]:.1f} %" if interval and entry["of"] else ""
        goals = (_goal(key, entry, "must"), _goal(key, entry, "aim"))
        rows.append((WORDS[key], _value(key, entry), shown, *goals, entry["met"]))
    return ("figure", "measured", "95 % interval", "must", "aim", "reached"), rows


def rows_table(rows: dict[str, Any], first: str) -> Table:
    """Return a table of groups of singles."""
    header = (
        first,
        "cases",
        "detected",
        "location",
        "first name",
        "in set",
        "unknown",
        "size error",
        "gap closed",
    )
    return header, [
        (
            name,
            str(row["cases"]),
            percent(row["detected"]),
            percent(row["location"]),
            percent(row["first_name"]),
            percent(row["in_set"]),
            str(row["unknown"]),
            percent(row["size_error"]),
            percent(row["gap_closed"]),
        )
        for name, row in rows.items()
    ]


def effect_table(result: dict[str, Any]) -> Table:
    """Return first name right (of isolable) by effect and size; detected where none is isolable."""
    summary = result["summary"]
    sizes = list(summary["by_size"])
    rows = []
    for effect, row in summary["by_effect"].items():
        cells = []
        for size in sizes:
            entry = row.get(size)
            if entry is None:
                cells.append("")
            elif entry["isolable"]:
                cells.append(f"{entry['first_name']['hits']}/{entry['first_name']['of']}")
            else:
                cells.append(f"({entry['detected']['hits']}/{entry['detected']['of']})")
        rows.append((effect, *cells))
    return ("effect", *sizes), rows


def baseline_table(result: dict[str, Any]) -> Table:
    """Return the methods side by side on the same cases."""
    rows = [
        (
            name,
            percent(entry["false_alarms"]),
            percent(entry["first_name"]),
            percent(entry["pairs"]),
            f"{entry['seconds']:.1f}",
        )
        for name, entry in result.get("baselines", {}).items()
    ]
    return ("method", "false alarms", "first name, d' ≥ 8", "both of a pair", "s per case"), rows


def _text_table(table: Table) -> str:
    header, rows = table
    lines = [header, tuple("---" for _ in header), *rows]
    return (
        "\n".join("| " + " | ".join(cell.replace("|", "/") for cell in line) + " |" for line in lines) + "\n"
    )


def markdown(result: dict[str, Any]) -> str:
    """Return the tables for the docs."""
    summary = result["summary"]
    cases = ", ".join(f"{number} {kind}" for kind, number in result["cases_asked"].items())
    asked = sum(result["cases_asked"].values())
    ran = result.get("cases_run", asked)
    told = f" The first {ran} of these {asked} have run, in an order drawn beforehand."
    part = "" if ran == asked else told
    parts = [
        f"Seed {result['seed']}; {cases}; labels sealed as `{result['digest']}`.{part}\n",
        "### Targets (effects of d' ≥ 8)\n",
        _text_table(targets_table(result)),
        "### By size\n",
        _text_table(rows_table(summary["by_size"], "size")),
        "### By effect and size: first name right of isolable cases, in brackets detected\n",
        _text_table(effect_table(result)),
        "### By loop and stage\n",
        _text_table(rows_table({**summary["by_loop"], **summary["by_stage"]}, "experiment")),
        "### Outside the table: called unknown\n",
        _text_table(
            (("physics", "unknown"), [(k, percent(v)) for k, v in summary["outside_by_effect"].items()])
        ),
    ]
    if result.get("baselines"):
        parts += [
            "### What people would otherwise do, on the same recordings\n",
            _text_table(baseline_table(result)),
        ]
    if summary["failed"]:
        parts += [
            "### Failures of the command\n",
            "\n".join(f"* {line}" for line in summary["failed"]) + "\n",
        ]
    return "\n".join(parts)


def confusion_figure(confusion: dict[str, dict[str, int]]) -> Figure:
    """Return the confusion matrix, rows normalised."""
    said = sorted({name for row in confusion.values() for name in row})
    truths = list(confusion)
    values = np.array([[row.get(name, 0) for name in said] for row in confusion.values()], dtype=float)
    shares = values / np.maximum(values.sum(axis=1, keepdims=True), 1.0)
    with styled({"font.size": 8}):
        figure = blank(10.0, 1.8 + 0.24 * len(truths))
        axis = figure.subplots()
        axis.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
        axis.set_xticks(range(len(said)), [s.replace("_", " ") for s in said], rotation=60, ha="right")
        axis.set_yticks(range(len(truths)), [t.replace("_", " ") for t in truths])
        for i, j in zip(*np.nonzero(values), strict=True):
            colour = "white" if shares[i, j] > 0.6 else "#333333"
            axis.text(j, i, f"{values[i, j]:.0f}", ha="center", va="center", color=colour, fontsize=7)
        axis.set_xlabel("said first")
        axis.set_ylabel("hidden")
    return figure


def power_figure(cases: Sequence[dict[str, Any]]) -> Figure:
    """Return detected and rightly named shares over d'."""
    singles = [c for c in cases if c["kind"] == "single"]
    with styled({"font.size": 9}):
        figure = blank(10.0, 2.8)
        axis = figure.subplots()
        for label, key, chosen in (
            ("detected", "detected", singles),
            ("first name right (isolable)", "name_right", [c for c in singles if c["isolable"]]),
        ):
            ordered = sorted(chosen, key=lambda c: c["detectability"][0])
            groups = [
                g for g in np.array_split(np.arange(len(ordered)), max(1, len(ordered) // 25)) if len(g)
            ]
            x = [np.median([ordered[i]["detectability"][0] for i in g]) for g in groups]
            y = [np.mean([bool(ordered[i][key]) for i in g]) for g in groups]
            axis.semilogx(x, y, "o-", label=label, markersize=3)
        axis.set_xlabel("detectability d'")
        axis.set_ylabel("share")
        axis.set_ylim(-0.03, 1.03)
        axis.legend(loc="lower right")
    return figure


def write_page(result: dict[str, Any], path: Path) -> Path:
    """Write the report and return its path."""
    summary = result["summary"]
    page = Page("Blind benchmark of the diagnosis", f"seed {result['seed']}, version {result['version']}")
    targets = summary["targets"]
    missed = [WORDS[k] for k, entry in targets.items() if entry["met"] == "missed"]
    if missed:
        page.verdict("bad", f"{len(missed)} targets missed: {'; '.join(missed)}.")
    else:
        page.verdict("good", "Every target that there was data for is met.")
    if summary["failed"]:
        page.verdict("bad", f"{len(summary['failed'])} diagnoses failed.")
    page.verdict("plain", f"Labels sealed before the first diagnosis: SHA-256 {result['digest']}.")
    for key in ("false_alarms", "detected", "first_name"):
        page.key_figure(percent(targets[key]), WORDS[key], f"must {_goal(key, targets[key], 'must')}")
    section = page.section("Targets", "Effects of detectability d' ≥ 8, as an ideal observer would see them.")
    section.table(*targets_table(result))
    section = page.section("By size")
    section.table(*rows_table(summary["by_size"], "size"))
    if any(case["kind"] == "single" for case in result["cases"]):
        section.picture(power_figure(result["cases"]), "Share detected and rightly named over d'.")
    page.section("By effect and size", "First name right of isolable cases; in brackets detected.").table(
        *effect_table(result)
    )
    page.section("By loop and stage").table(
        *rows_table({**summary["by_loop"], **summary["by_stage"]}, "experiment")
    )
    if summary["confusion"]:
        page.section("Confusion", "What was hidden, and what was said first.").picture(
            confusion_figure(summary["confusion"]), "Confusion matrix."
        )
    clean = summary["clean"]
    page.section("Clean recordings").table(
        ("recordings", "false alarms"),
        [(name.replace("_", " "), percent(clean[name])) for name in ("all", "without_trace", "with_trace")],
        f"A trace of d' below 1 was rightly named {clean['trace_named']} times, which counts as no alarm.",
    )
    page.section("Outside the table").table(
        ("physics", "called unknown"), [(k, percent(v)) for k, v in summary["outside_by_effect"].items()]
    )
    calibration = summary["calibration"]
    ece = "–" if calibration["ece"] is None else f"{calibration['ece']:.3f}"
    page.section("Calibration", f"Expected calibration error of the first name's confidence: {ece}.").table(
        ("stated from", "to", "cases", "mean stated", "right"),
        [
            (f"{r['from']:g}", f"{r['to']:g}", r["cases"], f"{r['stated']:.3f}", f"{r['right']:.3f}")
            for r in calibration["rows"]
        ],
    )
    if result.get("baselines"):
        page.section("What people would otherwise do").table(*baseline_table(result))
    if summary["failed"]:
        page.section("Failures of the command").table(("case",), [(line,) for line in summary["failed"]])
    return page.write(path)
