"""What changed since the robot was new, in sentences, and the content of trend.json."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .charts import Chart
from .trend import Trend


def change_sentence(trend: Trend) -> str:
    """What left its limits, by how much it is different now, and since when."""
    span = f"{trend.points[0].when} to {trend.points[trend.reference - 1].when}"
    lasting = [c for c in trend.charts if c.first is not None and c.outside[-1]]
    gone = [c for c in trend.charts if c.first is not None and not c.outside[-1]]
    parts = [f"{c.quantity.name} {changed(c)}, outside its limits since {_since(trend, c)}" for c in lasting]
    parts += [
        f"{c.quantity.name} left its limits at {_since(trend, c)} and is back within them" for c in gone
    ]
    parts += [
        f"{event} {'on' if trend.points[i].date else 'in'} {trend.points[i].when}"
        for i, events in sorted(trend.events.items())
        for event in events
    ]
    if not parts:
        return f"Nothing has left its limits since the reference ({span})."
    return f"Since the reference ({span}): {'; '.join(parts)}."


def changed(c: Chart) -> str:
    """How a quantity is different now: grew or fell, by how much, from and to."""
    unit = "" if c.quantity.unit == "1" else f" {c.quantity.unit}"
    way = "grew" if c.now > c.centre else "fell"
    share = f" by {100 * abs(c.change):.3g} %" if c.change == c.change else ""
    if c.quantity.logarithmic and c.change > 1.0:
        share = f" {1.0 + c.change:.3g}-fold"
    return f"{way}{share} ({c.shown(c.centre):.4g} to {c.shown(c.now):.4g}{unit})"


def alarm_sentence(trend: Trend) -> str:
    """What the limits promise."""
    return (
        f"Limits: a year of {trend.year} recordings in which nothing changes has a false alarm on any of the "
        f"{len(trend.charts)} charts with a probability of {100 * trend.alarms:g} % at most; the first "
        f"{trend.reference} recordings are the reference."
    )


def diagnose_commands(trend: Trend, model: Path, output: Path, mapping: str | None = None) -> list[list[str]]:
    """The commands that look into the first recording outside the limits, and into the newest, in which a
    change that grows is larger; empty where there is none."""
    wanted = dict.fromkeys(i for i in (trend.first, trend.newest) if i is not None)
    head = ["haptic-teleop", "diagnose", "--model", str(model), "--bags"]
    tail = ["--output", str(output), *(("--mapping", mapping) if mapping else ())]
    return [[*head, str(trend.points[i].path), *tail] for i in wanted]


def content(trend: Trend, commands: Sequence[Sequence[str]]) -> dict[str, Any]:
    """What trend.json says."""
    first = trend.first
    return {
        "schema": 1,
        "robot": trend.model.robot,
        "joint": trend.model.joint,
        "sentence": change_sentence(trend),
        "reference": [p.name for p in trend.points[: trend.reference]],
        "limits": {
            "what": "probability that a year of so many recordings in which nothing changes has any alarm",
            "false_alarms": trend.alarms,
            "recordings_per_year": trend.year,
            "charts": len(trend.charts),
        },
        "first_outside": None
        if first is None
        else {
            "recording": trend.points[first].name,
            "reasons": trend.reasons(first),
            "diagnose": [shlex.join(command) for command in commands],
        },
        "quantities": {c.quantity.name: _quantity(trend, c) for c in trend.charts},
        "not_watched": list(trend.unwatched),
        "recordings": [
            {
                "name": p.name,
                "path": str(p.path),
                "date": p.date.isoformat() if p.date else None,
                "outside": trend.reasons(i),
            }
            | {k: v for k, v in p.found.items() if k not in ("key", "status", "message")}
            for i, p in enumerate(trend.points)
        ],
        "unusable": [{"name": name, "why": why} for name, why in trend.unusable],
        "damaged": trend.damaged,
        "notes": list(trend.told),
    }


def _since(trend: Trend, c: Chart) -> str:
    assert c.first is not None
    return trend.points[c.first].when


def _quantity(trend: Trend, c: Chart) -> dict[str, Any]:
    return {
        "unit": c.quantity.unit,
        "scale": "logarithm" if c.quantity.logarithmic else "value",
        "reference": c.shown(c.centre),
        "spread": c.spread,
        "now": c.shown(c.now),
        "change": c.change,
        "now_std": c.now_std,
        "first_outside": None if c.first is None else trend.points[c.first].name,
        "outside": [trend.points[i].name for i in range(len(trend.points)) if c.outside[i]],
        "lowest": [c.shown(c.centre - h) for h in c.half],
        "highest": [c.shown(c.centre + h) for h in c.half],
        "moving_average": list(c.average),
    }
