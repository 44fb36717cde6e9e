"""The benchmark's tables, for its page and as Markdown for the docs."""

from __future__ import annotations

import re
from typing import Any

WORDS = {
    "false_alarms": "false alarms on clean recordings",
    "detected": "effects detected",
    "location": "location right, of those detected",
    "first_name": "first name right, where isolable",
    "in_set": "truth in the stated set, of those named",
    "set_size": "mean size of the stated set",
    "cannot_tell": "indistinguishable effects called `ambiguous`",
    "wrongly_ambiguous": "isolable effects called `ambiguous`",
    "outside_unknown": "physics without a name called `unknown`",
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


def goal(key: str, entry: dict[str, Any], which: str) -> str:
    """Write what a figure "must" reach, or is to "aim" at."""
    if entry["sense"] == "within":
        return "80–97 %" if which == "must" else "86–94 %"
    sign = "≥" if entry["sense"] == "at least" else "≤"
    return f"{sign} {entry[which]:g}" if key == "set_size" else f"{sign} {100 * entry[which]:g} %"


def targets_table(result: dict[str, Any]) -> Table:
    """Return the targets of the issue with what was measured; what fits a narrow screen comes first."""
    rows = []
    for key, entry in result["summary"]["targets"].items():
        interval = entry.get("interval")
        shown = f"{100 * interval[0]:.1f}–{100 * interval[1]:.1f} %" if interval and entry["of"] else ""
        goals = (goal(key, entry, "must"), goal(key, entry, "aim"))
        rows.append((WORDS[key], _value(key, entry), entry["met"], *goals, shown))
    return ("figure", "measured", "reached", "must", "aim", "95 % interval"), rows


def _size_text(name: str) -> str:
    """A class of sizes, which has zeros to be sorted by, as a reader writes it."""
    return re.sub(r"(?<= )0+(?=\d)", "", name)


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
            _size_text(name),
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
    return ("effect", *map(_size_text, sizes)), rows


def together_table(summary: dict[str, Any]) -> Table:
    """Return how many of several effects that are hidden together are named."""
    rows = []
    for kind, entry in summary["together"].items():
        if entry["all"]["of"]:
            means = (f"{entry[key]['value']:.2f}" for key in ("right_names", "wrong_names"))
            rows.append((kind, percent(entry["all"]), percent(entry["one_and_none_wrong"]), *means))
    return ("hidden", "all named", "one named, and none wrong", "right names", "wrong names"), rows


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


def confusion_table(confusion: dict[str, dict[str, int]], outside: set[str]) -> Table:
    """Return the effects that were not always said as what they are, the most often mistaken first.

    outside: the effects that have no name, for which "unknown" is the right answer.
    """
    rows = []
    for truth, said in confusion.items():
        right = "unknown" if truth in outside else "no_mismatch" if truth == "none" else truth
        wrong = sorted(((n, name) for name, n in said.items() if name != right), key=lambda w: (-w[0], w[1]))
        if wrong:
            told = ", ".join(f"{_plain(name)} {n}" for n, name in wrong)
            share = f"{said.get(right, 0)}/{sum(said.values())}"
            hidden = "nothing" if truth == "none" else _plain(truth)
            rows.append((sum(n for n, _ in wrong), hidden, share, told))
    rows.sort(key=lambda row: (-row[0], row[1]))
    return ("hidden", "named so", "said instead, and how often"), [row[1:] for row in rows]


def _plain(name: str) -> str:
    return name.replace("_", " ")


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
        "### Several effects together\n",
        _text_table(together_table(summary)),
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
