"""One case's score: what `diagnose` said against what was hidden, from diagnosis.json only."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

Explanation = tuple[str, str]
VERDICTS = ("identified", "ambiguous", "unknown", "no_mismatch")
NINETY = 1.645
RECOVERABLE = 1.0
"""Percent of fit that must lie between baseline and floor before a share of it is spoken of."""


def read_diagnosis(directory: Path) -> dict[str, Any]:
    """Return a case's diagnosis, with verdict "failed" where the command failed or its result is broken."""
    ran = json.loads((directory / "run.json").read_text())
    path = directory / "diagnosis" / "diagnosis.json"
    failed = {"verdict": "failed", "wall_s": ran["seconds"], "message": ran["message"] or ran["status"]}
    if ran["status"] != "0" or not path.exists():
        return failed
    try:
        found = json.loads(path.read_text())
    except json.JSONDecodeError as error:
        return {**failed, "message": f"diagnosis.json is no JSON: {error}"}
    if not isinstance(found, dict) or found.get("verdict") not in VERDICTS:
        return {**failed, "message": "diagnosis.json has no known verdict"}
    return {**found, "wall_s": ran["seconds"]}


def named(diagnosis: dict[str, Any]) -> list[Explanation]:
    """Return the first name of every finding, (effect, location)."""
    return [(f["effect"], f["location"]) for f in diagnosis.get("findings") or []]


def stated_set(diagnosis: dict[str, Any]) -> list[Explanation]:
    """Return what the verdict commits itself to: all that `ambiguous` lists, the findings of `identified`."""
    found = named(diagnosis)
    if diagnosis["verdict"] == "ambiguous":
        for finding in diagnosis.get("findings") or []:
            found += [(a["effect"], a["location"]) for a in finding.get("alternatives") or []]
    return list(dict.fromkeys(found))


def place(diagnosis: dict[str, Any]) -> str | None:
    """Return the location that is named first: of the first finding, else of `where`."""
    found = named(diagnosis)
    if found:
        return found[0][1]
    where = diagnosis.get("where") or []
    return where[0]["equation"] if where else None


def score_case(name: str, label: dict[str, Any], directory: Path) -> dict[str, Any]:
    """Return the score of one case as plain data; keys that do not apply are None."""
    diagnosis = read_diagnosis(directory)
    truths = [(t["effect"], t["location"]) for t in label["truth"]]
    sets: list[list[Explanation]] = [[(e, p) for e, p in one] for one in label["sets"]]
    firsts, stated = named(diagnosis), stated_set(diagnosis)
    verdict = diagnosis["verdict"]
    detected = verdict not in ("no_mismatch", "failed")
    is_named = verdict in ("identified", "ambiguous") and bool(firsts)
    score: dict[str, Any] = {
        "case": name,
        "kind": label["kind"],
        "stage": label["stage"],
        "loop": label["loop"],
        "truth": [f"{e} @ {p}" for e, p in truths],
        "detectability": [t["detectability"] for t in label["truth"]],
        "isolable": bool(label.get("isolable")),
        "trace_of": label.get("trace_of"),
        "verdict": verdict,
        "said": [f"{e} @ {p}" for e, p in firsts],
        "stated": [f"{e} @ {p}" for e, p in stated],
        "place": place(diagnosis),
        "detected": detected,
        "named": is_named,
        "confidence": firsts and diagnosis["findings"][0].get("confidence"),
        "runtime_s": diagnosis.get("runtime_s"),
        "wall_s": diagnosis["wall_s"],
        "message": diagnosis.get("message", ""),
    }
    score["confidence"] = score["confidence"] if is_named else None
    if len(truths) == 1:
        allowed = sets[0]
        score["location_right"] = place(diagnosis) in {p for _, p in allowed} if detected else None
        score["name_right"] = is_named and firsts[0][0] == truths[0][0]
        score["in_set"] = any(s[0] == truths[0][0] and s in allowed for s in stated) if is_named else False
        score["set_size"] = len(stated) if is_named else None
        rivals = [s for s in stated if s != truths[0] and s in allowed]
        score["cannot_tell"] = verdict == "ambiguous" and truths[0] in stated and bool(rivals)
    if len(truths) > 1:
        hit = [any(f in allowed for f in firsts) for allowed in sets]
        wrong = [f for f in firsts if not any(f in allowed for allowed in sets)]
        score["all_named"], score["right_names"] = all(hit), sum(hit)
        score["one_and_none_wrong"] = any(hit) and not wrong
        score["named_wrong"] = len(wrong)
    if label["kind"] == "clean":
        only_trace = bool(firsts) and all(f[0] == label.get("trace_of") for f in firsts)
        score["false_alarm"] = verdict not in ("no_mismatch",) and not only_trace
        score["found_trace"] = only_trace
    score["parameters"] = _parameters(label, diagnosis) if is_named else []
    score["fit"] = _fit(label, diagnosis)
    return score


def _parameters(label: dict[str, Any], diagnosis: dict[str, Any]) -> list[dict[str, Any]]:
    """Return value, truth, relative error and whether the 90 % interval holds the truth, for right names."""
    found = []
    nominal = label.get("truth_parameters", {}).get("torque_constant")
    for truth in label["truth"]:
        match = next(
            (
                f
                for f in diagnosis["findings"]
                if (f["effect"], f["location"]) == (truth["effect"], truth["location"])
            ),
            None,
        )
        if match is None:
            continue
        for number, key in enumerate(truth["scored"]):
            estimate = (match.get("parameters") or {}).get(key)
            if estimate is None or estimate.get("value") is None:
                continue
            candidates = _conventions(truth["effect"], key, truth["parameters"][key], label, nominal)
            value, std = float(estimate["value"]), estimate.get("std")
            right = min(candidates, key=lambda c: abs(value - c))
            # Of a factor near one (a gain, a scale) the size is what it differs from one by.
            size = right - 1.0 if key in ("gain", "scale") and abs(right) > 0.5 else right
            error = abs(value - right) / abs(size) if size else math.inf
            covered = None if not std else bool(abs(value - right) <= NINETY * float(std))
            found.append(
                {
                    "effect": truth["effect"],
                    "parameter": key,
                    "truth": right,
                    "value": value,
                    "error": error,
                    "covered": covered,
                    "is_size": number == 0,
                    "detectability": truth["detectability"],
                }
            )
    return found


def _conventions(
    effect: str, key: str, truth: float, label: dict[str, Any], torque_constant: float | None
) -> list[float]:
    """Return the values that these words allow for the same physics.

    A torque limit or dead band of the amplifier may be told by the true torque constant or by the nominal one
    of the messages; a scale as factor or as deviation from one.
    """
    values = [truth]
    if effect in ("torque_saturation", "torque_speed_limit", "dead_zone") and torque_constant:
        nominal = {"stage1": 8.925, "stage2": 1.392}[label["stage"]]
        values.append(truth * nominal / torque_constant)
    if key in ("scale", "gain"):
        values.append(truth - 1.0)
    return values


def _fit(label: dict[str, Any], diagnosis: dict[str, Any]) -> dict[str, Any] | None:
    """Return the mean held-out fit of the velocities before and after, the floor, and the share closed."""
    fit = diagnosis.get("fit") or {}
    before = (fit.get("baseline") or {}).get("validation") or {}
    after = (fit.get("augmented") or {}).get("validation") or {}
    floor = (label.get("floor") or {}).get("validation") or {}
    names = [n for n in next(iter(floor.values()), {}) if _number(before.get(n)) and _number(after.get(n))]
    if not names:
        return None
    closest = _window(fit, label["loop"])
    mean = {
        key: sum(values[n] for n in names) / len(names)
        for key, values in (("before", before), ("after", after), ("floor", floor[closest]))
    }
    recoverable = mean["floor"] - mean["before"]
    return {
        **mean,
        "window": closest,
        "share": (mean["after"] - mean["before"]) / recoverable if recoverable > RECOVERABLE else None,
        "harm": (100.0 - mean["after"]) > 1.02 * (100.0 - mean["before"]) + 1e-9,
    }


def _number(value: object) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


def _window(fit: dict[str, Any], loop: str) -> str:
    """Return the floor's window nearest to the one reported: as a number, in words, or else the usual one."""
    window, words = fit.get("window_s"), str(fit.get("windows", "")).rpartition("validation:")[2]
    if not isinstance(window, (int, float)):
        cut = "made in closed loop" in words or "drifts by" in words
        return "4" if cut or not loop.startswith("open") else "whole"
    if window > 12.0:
        return "whole"
    return min(("1", "2", "4", "8"), key=lambda w: abs(math.log(float(w) / window)))
