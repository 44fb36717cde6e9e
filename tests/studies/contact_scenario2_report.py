"""The tables of contact_scenario2.py."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from contact_scenario2 import AXES, COLUMNS, TORQUES, WALLS, Merit

Found = Mapping[tuple[str, float, float, str], Merit | None]
"""(device, desired torque, wall, axis) -> what came of it."""


def report(found: Found) -> str:
    """All tables, as Markdown."""
    parts = ["### Scenario 2: the nominal device, run by run", "", _nominal(found), ""]
    parts += ["### Scenario 2: all devices and torques, with and without friction", "", _by_wall(found), ""]
    return "\n".join([*parts, "### Scenario 2: where the aim is missed", "", _misses(found)])


def _row(merits: Sequence[Merit | None]) -> list[str]:
    there = [one for one in merits if one is not None]
    if not there:
        return ["–"] * (len(COLUMNS) - 1) + [f"0 of {len(merits)}"]
    settled = [one.settling for one in there if not math.isnan(one.settling)]
    times = f"{np.median(settled):.2f} / {max(settled):.2f}" if settled else "–"
    never = len(merits) - len(settled)
    return [
        _pair([abs(one.speed_error) for one in there], 1),
        f"{np.median([one.free_rms for one in there]):.0f}",
        _pair([one.overshoot for one in there], 0),
        _pair([one.bounces for one in there], 0),
        f"{np.median([one.impulse for one in there]):.3f}",
        times + (f", {never} never" if never else ""),
        f"{np.nanmedian([one.contact_rms for one in there]):.1f}",
        f"{sum(one.meets_aim for one in there)} of {len(merits)}",
    ]


def _pair(values: Sequence[float], digits: int) -> str:
    return f"{np.median(values):.{digits}f} / {max(values):.{digits}f}"


def _table(first: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = [*first, *COLUMNS] if len(rows[0]) == len(first) + len(COLUMNS) else list(first)
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def _by_wall(found: Found) -> str:
    rows = []
    for axis in AXES:
        for wall in WALLS:
            rows.append(
                [axis, f"{wall:g}", *_row([m for (_, _, w, a), m in found.items() if (w, a) == (wall, axis)])]
            )
        rows.append([axis, "**all**", *_row([m for (_, _, _, a), m in found.items() if a == axis])])
    return _table(("axis", "wall, N·m/rad"), rows)


def _nominal(found: Found) -> str:
    head = (
        "axis", "Td, N·m", "wall, N·m/rad", "free-speed error, %", "free rms, %",
        "peak of the wall's torque, N·m", "bounces", "impulse, N·m·s", "settled, N·m", "settling, s",
        "rms Td − Te, mN·m",
    )  # fmt: skip
    rows = []
    for axis in AXES:
        for desired in TORQUES:
            for wall in WALLS:
                one = found["nominal", desired, wall, axis]
                assert one is not None
                rows.append([
                    axis, f"{desired:g}", f"{wall:g}", f"{one.speed_error:+.1f}", f"{one.free_rms:.0f}",
                    f"{one.peak:.3f}", str(one.bounces), f"{one.impulse:.3f}", f"{one.settled:.3f}",
                    f"{one.settling:.2f}", f"{one.contact_rms:.1f}",
                ])  # fmt: skip
    return _table(head, rows)


def _misses(found: Found) -> str:
    reasons: dict[str, Callable[[Merit | None], bool]] = {
        "never reaches the wall": lambda m: m is None,
        "overshoot above 5 %": lambda m: m is not None and m.overshoot > 5.0,
        "a second bounce": lambda m: m is not None and m.bounces > 1,
        "free speed off by more than 2 %": lambda m: m is not None and abs(m.speed_error) > 2.0,
        "not settled within ±5 %": lambda m: m is not None and math.isnan(m.settling),
    }
    groups = {
        "nominal": lambda name: name == "nominal",
        "nominal, no friction": lambda name: name == "nominal, no friction",
        "corners": lambda name: name.startswith("corner") and "," not in name,
        "corners, no friction": lambda name: name.startswith("corner") and "," in name,
    }
    rows = []
    for reason, holds in reasons.items():
        cells = []
        for belongs in groups.values():
            chosen = [m for (name, *_), m in found.items() if belongs(name)]
            cells.append(f"{sum(map(holds, chosen))} of {len(chosen)}")
        rows.append([reason, *cells])
    return _table(("both axes", *groups), rows)
