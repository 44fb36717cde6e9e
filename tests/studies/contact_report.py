"""The tables and the picture of contact_quality.py; docs/contact.md has the picture and a summary."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import matplotlib
import numpy as np
from contact_quality import DT, LAMBDA, WALLS, Case, Merit, Plant, simulate
from matplotlib.figure import Figure
from scipy.optimize import brentq

from haptic_teleop_control.laws import find_law
from haptic_teleop_control.robots import SFJ_STAGES, STAGES

Results = dict[str, list[Merit]]


def _worst(merits: Sequence[Merit], value: Callable[[Merit], float]) -> float:
    return max(map(value, merits))


def _cell(merits: Sequence[Merit]) -> list[str]:
    strong = [one for one in merits if not one.weak]
    settled = [one.settling for one in merits if not math.isnan(one.settling)]
    unsettled = len(merits) - len(settled)
    times = f"{np.median(settled):.2f} / {max(settled):.2f}" if settled else "–"
    return [
        f"{np.median([one.overshoot for one in merits]):.1f} / {_worst(merits, lambda m: m.overshoot):.1f}",
        f"{np.median([one.bounces for one in merits]):.0f} / {_worst(merits, lambda m: m.bounces):.0f}",
        f"{np.median([one.impulse for one in merits]):.3f}",
        times + (f", {unsettled} never" if unsettled else ""),
        f"{np.median([one.contact_rms for one in merits]):.1f}",
        f"{np.median([abs(m.speed_error) for m in strong]):.1f} / "
        f"{_worst(strong, lambda m: abs(m.speed_error)):.1f}",
        f"{np.median([one.free_rms for one in merits]):.0f}",
        f"{sum(one.meets_aim for one in merits)} of {len(merits)}",
    ]


HEADER = (
    "overshoot, %",
    "bounces",
    "impulse, N·m·s",
    "settling, s",
    "rms Td − Te, mN·m",
    "free-speed error, %",
    "free rms, %",
    "aim met",
)


def _table(rows: Sequence[Sequence[str]], first: Sequence[str]) -> str:
    lines = ["| " + " | ".join([*first, *HEADER]) + " |", "|" + "---|" * (len(first) + len(HEADER))]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def _by_wall(results: Results, stage: str) -> str:
    rows = []
    for wall in WALLS:
        for law, merits in results.items():
            chosen = [m for m in merits if m.stage == stage and m.case.wall == wall]
            rows.append([f"{wall:g}", law, *_cell(chosen)])
    for law, merits in results.items():
        rows.append(["**all**", law, *_cell([m for m in merits if m.stage == stage])])
    return _table(rows, ("wall, N·m/rad", "law"))


def _failures(merits: Sequence[Merit]) -> str:
    reasons: dict[str, Callable[[Merit], bool]] = {
        "overshoot above 5 %": lambda m: m.overshoot > 5.0,
        "a second bounce": lambda m: m.bounces > 1,
        "a third bounce or more": lambda m: m.bounces > 2,
        "free speed off by more than 2 %, drive strong enough": lambda m: (
            not m.weak and abs(m.speed_error) > 2.0
        ),
        "drive too weak for Td/λ (not counted against the law)": lambda m: m.weak,
        "not settled within the run": lambda m: math.isnan(m.settling),
    }
    lines = ["| | stage 1 | stage 2 | at walls of, N·m/rad |", "|---|---|---|---|"]
    for name, holds in reasons.items():
        found = [m for m in merits if holds(m)]
        counts = [sum(m.stage == stage for m in found) for stage in STAGES]
        totals = [sum(m.stage == stage for m in merits) for stage in STAGES]
        walls = ", ".join(f"{wall:g}" for wall in sorted({m.case.wall for m in found})) or "–"
        shares = [f"{count} of {total}" for count, total in zip(counts, totals, strict=True)]
        lines.append(f"| {name} | {' | '.join(shares)} | {walls} |")
    return "\n".join(lines)


def limits(speed: float = 1.0) -> str:
    """What no law can change, for the nominal plant at a stiff wall, as a table in Markdown.

    The wall gives a share of the speed back that follows from its dissipation d alone (Hunt and Crossley:
    d v' + ln(1 - d v') + d v - ln(1 + d v) = 0, v before and v' after). The arm then flies back until at most
    Td has stopped it; the drive needs a while to load and unload the joint at its current limit.
    """
    rows = [
        "| at Td/λ = 1 rad/s | stage 1 | stage 2 |",
        "|---|---|---|",
    ]
    found: dict[str, list[str]] = {}
    for stage in STAGES:
        model, facts = Plant("nominal").model(stage, 2000.0), SFJ_STAGES[stage]
        p, desired = model.parameters, LAMBDA * speed
        back = brentq(
            lambda v: v + math.log1p(-v) + speed - math.log1p(speed), 1e-9, 1.0 - 1e-12
        )  # d = 1 s/rad
        friction = sum(e.parameters["torque"] for e in model.effects if e.effect == "coulomb_friction")
        driving = p["torque_constant"] * facts.current_limit - friction - desired
        swing = desired / p["stiffness"]
        values = {
            "energy of the arm at the touch, mJ": 500.0 * p["arm_inertia"] * speed**2,
            "energy in the joint at Td, mJ": 500.0 * desired**2 / p["stiffness"],
            "speed after the wall, rad/s": back,
            "flight away from the wall, braked with Td, mrad": 500.0 * p["arm_inertia"] * back**2 / desired,
            "duration of that flight there and back, ms": 2e3 * p["arm_inertia"] * back / desired,
            "stroke of the drive between Te = 0 and Td, mrad": 1e3 * swing,
            "time for it, at full current there and back, ms": 1e3 * _stroke(swing, driving, p),
            "greatest speed of the drive in free motion, rad/s": Plant("nominal").top_speed(stage),
        }
        for name, value in values.items():
            found.setdefault(name, []).append(f"{value:.3g}")
    return "\n".join(rows + [f"| {name} | {' | '.join(values)} |" for name, values in found.items()])


def _stroke(swing: float, driving: float, p: Mapping[str, float]) -> float:
    """s, for a drive to move by `swing`, rad, from rest to rest: full torque one way, then the other."""
    inertia, damping = p["motor_inertia"], p["motor_damping"]
    time, speed, angle = 0.0, 0.0, 0.0
    while angle < 0.5 * swing:
        speed += 1e-5 * (driving - damping * speed) / inertia
        angle += 1e-5 * speed
        time += 1e-5
    return 2.0 * time


def tables(results: Results, others: dict[str, Results]) -> str:
    """All tables as Markdown."""
    parts = []
    for stage in STAGES:
        parts += [
            f"### {stage.replace('stage', 'Stage ')}: all plants, speeds and frictions",
            _by_wall(results, stage),
        ]
    for law, merits in results.items():
        parts += [f"### Where the aim is missed: {law}", _failures(merits)]
    rows = [
        [
            name,
            stage.replace("stage", "stage "),
            law,
            *_cell([m for m in merits if m.stage == stage]),
        ]
        for name, found in others.items()
        for stage in STAGES
        for law, merits in found.items()
    ]
    parts += [
        "### Beside the grid: the nominal plant at walls of 100 and 2000 N·m/rad",
        _table(rows, ("", "stage", "law")),
    ]
    parts += ["### What no law can change", limits()]
    return "\n\n".join(parts)


def picture(laws: Sequence[str], speed: float = 1.0) -> Figure:
    """Contact torque of both stages at a soft and at a hard wall, all laws."""
    colours = ("#8a8f98", "#2166ad", "#c2570d", "#1a7f5b")
    with matplotlib.rc_context({"font.size": 8.5, "axes.grid": True, "grid.color": "#dfe3ea"}):
        figure = Figure(figsize=(8.6, 4.6), layout="constrained")
        axes = figure.subplots(2, 2, sharey="row")
        for row, stage in enumerate(STAGES):
            for column, wall in enumerate((100.0, 2000.0)):
                axis = axes[row, column]
                for law, colour in zip(laws, colours, strict=False):
                    made = find_law(law).from_parameters({}, STAGES, DT)
                    time, shown = simulate(Case(Plant("nominal"), wall, speed), made)
                    axis.plot(time, shown[:, 2, 2 * row + 1], color=colour, linewidth=1.2, label=law)
                axis.axhline(LAMBDA * speed, color="#1c2431", linewidth=0.8, linestyle="--")
                axis.set_xlim(0.0, 5.0)
                axis.set_title(f"{stage.replace('stage', 'stage ')}, wall {wall:g} N·m/rad", fontsize=9)
            axes[row, 0].set_ylabel("Te, N·m")
        axes[1, 0].legend(frameon=False, loc="center right")
        for axis in axes[1]:
            axis.set_xlabel("time, s")
    return figure
