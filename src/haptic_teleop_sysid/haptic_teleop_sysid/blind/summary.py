"""All scores together: the targets of the issue, tables by effect, size, loop and stage, calibration."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from statistics import NormalDist, mean, median
from typing import Any

from .calibration import calibration
from .cases import TOGETHER

Scores = list[dict[str, Any]]
STRONG = 8.0
"""d' from which the targets hold; sizes are sought to within 10 %, and judged as the recording has them."""
_LEAST = 0.9 * STRONG
TARGETS: dict[str, tuple[str, float, float]] = {
    "false_alarms": ("at most", 0.05, 0.01),
    "detected": ("at least", 0.90, 0.97),
    "location": ("at least", 0.92, 0.97),
    "first_name": ("at least", 0.85, 0.93),
    "in_set": ("at least", 0.95, 0.98),
    "set_size": ("at most", 2.0, 1.5),
    "cannot_tell": ("at least", 0.90, 0.97),
    "wrongly_ambiguous": ("at most", 0.10, 0.05),
    "outside_unknown": ("at least", 0.70, 0.85),
    "pair_both": ("at least", 0.60, 0.75),
    "size_error": ("at most", 0.10, 0.05),
    "coverage": ("within", 0.80, 0.97),
    "gap_closed": ("at least", 0.80, 0.95),
    "no_harm": ("at least", 0.98, 1.0),
}


def wilson(hits: int, total: int, level: float = 0.95) -> tuple[float, float]:
    """Return the Wilson score interval of a rate; (0, 1) without trials."""
    if not total:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + level / 2)
    p = hits / total
    centre = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * math.sqrt(p * (1 - p) / total + z * z / (4 * total * total))
    return max(0.0, centre - half), min(1.0, centre + half)


def rate(values: Iterable[Any]) -> dict[str, Any]:
    """Return {"rate", "hits", "of", "interval"} of truth values; None are left out."""
    kept = [bool(v) for v in values if v is not None]
    hits = sum(kept)
    return {
        "rate": hits / len(kept) if kept else None,
        "hits": hits,
        "of": len(kept),
        "interval": list(wilson(hits, len(kept))),
    }


def middle(values: Iterable[float | None], average: bool = False) -> dict[str, Any]:
    """Return {"value", "of"}: the median, or the mean, of what is not None."""
    kept = [v for v in values if v is not None]
    value = (mean(kept) if average else median(kept)) if kept else None
    return {"value": value, "of": len(kept)}


def summarise(scores: Scores) -> dict[str, Any]:
    """Return the whole summary as plain data."""
    by_kind: dict[str, Scores] = defaultdict(list)
    for score in scores:
        by_kind[score["kind"]].append(score)
    singles, clean = by_kind["single"], by_kind["clean"]
    strong = [s for s in singles if s["detectability"][0] >= _LEAST]
    return {
        "targets": _targets(strong, by_kind),
        "clean": {
            "all": rate(s["false_alarm"] for s in clean),
            "without_trace": rate(s["false_alarm"] for s in clean if s["trace_of"] is None),
            "with_trace": rate(s["false_alarm"] for s in clean if s["trace_of"] is not None),
            "trace_named": sum(s["found_trace"] for s in clean),
        },
        "by_size": {size: _row(found) for size, found in _grouped(singles, _size).items()},
        "by_effect": {
            effect: {"all": _row(found), **{k: _row(v) for k, v in _grouped(found, _size).items()}}
            for effect, found in _grouped(singles, lambda s: _unstaged(s["truth"][0])).items()
        },
        "by_loop": {loop: _row(found) for loop, found in _grouped(strong, lambda s: s["loop"]).items()},
        "by_stage": {stage: _row(found) for stage, found in _grouped(strong, lambda s: s["stage"]).items()},
        "confusion": _confusion(strong, by_kind["outside"], clean),
        "together": {
            kind: {
                "all": rate(s["all_named"] for s in by_kind[kind]),
                "one_and_none_wrong": rate(s["one_and_none_wrong"] for s in by_kind[kind]),
                "right_names": middle((s["right_names"] for s in by_kind[kind]), average=True),
                "wrong_names": middle((s["named_wrong"] for s in by_kind[kind]), average=True),
            }
            for kind in TOGETHER
        },
        "outside_by_effect": {
            effect: rate(s["verdict"] == "unknown" for s in found)
            for effect, found in _grouped(by_kind["outside"], lambda s: _unstaged(s["truth"][0])).items()
        },
        "calibration": calibration(
            s for s in scores if s["kind"] != "single" or s["detectability"][0] >= _LEAST
        ),
        "failed": [f"{s['case']}: {s['message']}" for s in scores if s["verdict"] == "failed"],
        "time": {
            "runtime_s": middle(s["runtime_s"] for s in scores),
            "wall_s": middle(s["wall_s"] for s in scores),
            "slowest_s": max((s["wall_s"] for s in scores), default=None),
        },
    }


def _targets(strong: Scores, by_kind: dict[str, Scores]) -> dict[str, dict[str, Any]]:
    detected = [s for s in strong if s["detected"]]
    named = [s for s in strong if s["named"]]
    sizes = [p for s in strong for p in s["parameters"] if p["is_size"]]
    intervals = [p["covered"] for s in strong for p in s["parameters"]]
    fits = [s["fit"] for s in strong if s["fit"] and s["name_right"]]
    accepted = [s["fit"] for found in by_kind.values() for s in found if s["fit"] and s["named"]]
    found: dict[str, dict[str, Any]] = {
        "false_alarms": rate(s["false_alarm"] for s in by_kind["clean"]),
        "detected": rate(s["detected"] for s in strong),
        "location": rate(s["location_right"] for s in detected),
        "first_name": rate(s["name_right"] for s in strong if s["isolable"]),
        "in_set": rate(s["in_set"] for s in named),
        "set_size": middle((s["set_size"] for s in named), average=True),
        "cannot_tell": rate(s["cannot_tell"] for s in by_kind["tied"]),
        "wrongly_ambiguous": rate(s["verdict"] == "ambiguous" for s in detected if s["isolable"]),
        "outside_unknown": rate(s["verdict"] == "unknown" for s in by_kind["outside"]),
        "pair_both": rate(s["all_named"] for s in by_kind["pair"]),
        "size_error": middle(p["error"] for p in sizes),
        "coverage": rate(intervals),
        "gap_closed": middle(f["share"] for f in fits),
        "no_harm": rate(not f["harm"] for f in accepted),
    }
    for key, (sense, must, aim) in TARGETS.items():
        value = found[key].get("rate", found[key].get("value"))
        found[key] |= {"sense": sense, "must": must, "aim": aim, "met": _met(key, value)}
    return found


def _met(key: str, value: float | None) -> str:
    """Return "aim", "must", "missed", or "no data"."""
    if value is None:
        return "no data"
    sense, must, aim = TARGETS[key]
    if sense == "within":
        return "aim" if 0.86 <= value <= 0.94 else "must" if must <= value <= aim else "missed"
    reaches = (lambda goal: value >= goal) if sense == "at least" else (lambda goal: value <= goal)
    return "aim" if reaches(aim) else "must" if reaches(must) else "missed"


def _row(found: Scores) -> dict[str, Any]:
    return {
        "cases": len(found),
        "detected": rate(s["detected"] for s in found),
        "location": rate(s["location_right"] for s in found if s["detected"]),
        "first_name": rate(s["name_right"] for s in found if s["isolable"]),
        "in_set": rate(s["in_set"] for s in found if s["named"]),
        "isolable": sum(s["isolable"] for s in found),
        "ambiguous": sum(s["verdict"] == "ambiguous" for s in found),
        "unknown": sum(s["verdict"] == "unknown" for s in found),
        "size_error": middle(p["error"] for s in found for p in s["parameters"] if p["is_size"]),
        "gap_closed": middle(s["fit"]["share"] for s in found if s["fit"] and s["name_right"]),
    }


def _grouped(scores: Scores, key: Any) -> dict[str, Scores]:
    found: dict[str, Scores] = defaultdict(list)
    for score in scores:
        found[key(score)].append(score)
    return dict(sorted(found.items()))


def _size(score: dict[str, Any]) -> str:
    """Return the class of a case's d': powers of two, widened by four."""
    value = score["detectability"][0]
    for low, high in ((0, 4), (4, 16), (16, 64), (64, 256)):
        if value < high:
            return f"d' {low:03d} to {high:03d}"
    return "d' 256 and more"


def _unstaged(explanation: str) -> str:
    effect, _, location = explanation.partition(" @ ")
    return f"{effect} @ {location.partition('_')[2]}"


def _confusion(strong: Scores, outside: Scores, clean: Scores) -> dict[str, dict[str, int]]:
    """Return {true effect: {what was said first: how often}}."""
    table: dict[str, dict[str, int]] = {}
    for score in [*strong, *outside, *clean]:
        truth = score["truth"][0].partition(" @ ")[0] if score["truth"] else "none"
        said = score["said"][0].partition(" @ ")[0] if score["named"] else score["verdict"]
        row = table.setdefault(truth, {})
        row[said] = row.get(said, 0) + 1
    return dict(sorted(table.items()))
