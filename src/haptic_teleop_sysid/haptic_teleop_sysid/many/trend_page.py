"""A trend as a page and as a table that other programs read."""

from __future__ import annotations

import csv
import shlex
from collections.abc import Sequence
from pathlib import Path

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.report import Page, unit_text

from .trend import Trend
from .trend_picture import changes_picture, charts_plot
from .trend_words import alarm_sentence, change_sentence, changed

_STATISTICS = (
    "A parameter's limits hold the scatter of the reference and the recording's own standard error; half of "
    "the false alarms are left to single recordings, half to a moving average that gives the newest a weight "
    "of 0.2 (Roberts 1959). That mean and scatter come from few recordings is in the limits (Jensen et al. "
    "2006): they are simulated for this number of recordings. Quantities of one motion depend on each other; "
    "the probability is shared among them (Bonferroni), which holds however they do."
)


def trend_page(trend: Trend, commands: Sequence[Sequence[str]]) -> Page:
    """Return the report; ``commands``: what looks into recordings outside the limits."""
    model = trend.model
    last = len(trend.points) - 1
    page = Page(
        "What changed since the robot was new",
        f"{model.robot} {model.joint}, {counted(len(trend.points), 'recording')}, {trend.points[0].when} to "
        f"{trend.points[last].when}",
    )
    first = trend.first
    status = "good" if first is None else "bad"
    if commands:
        page.conclude(status, change_sentence(trend), "look into it.", shlex.join(commands[0]))
    else:
        page.conclude(status, change_sentence(trend), "nothing.")
    if first is not None:
        reasons = "; ".join(trend.reasons(first))
        page.verdict("fair", f"First outside: {trend.points[first].when}: {reasons}.")
    if trend.unusable:
        page.verdict("fair", f"{counted(len(trend.unusable), 'recording')} could not be used, see below.")
    for note in trend.told:
        page.verdict("plain", f"{note[0].upper()}{note[1:]}.")
    page.verdict("plain", alarm_sentence(trend))
    page.section("Now against the reference").picture(
        changes_picture(trend),
        "Change of each quantity in percent, of errors as a factor, with two standard errors",
    ).table(
        ("quantity", "unit", "reference", "now", "change", "std. error", "first outside"),
        [
            (
                c.quantity.name,
                unit_text(c.quantity.unit),
                f"{c.shown(c.centre):.4g}",
                f"{c.shown(c.now):.4g}",
                changed(c).split(" (")[0],
                f"{c.now_std:.2g}" + (" (of the logarithm)" if c.quantity.logarithmic else ""),
                "–" if c.first is None else trend.points[c.first].when,
            )
            for c in trend.charts
        ],
    )
    if commands:
        which = ("Look into the first recording outside", "Look into the newest, where a change has grown")
        page.section("Next").commands(
            [(what, shlex.join(command)) for what, command in zip(which, commands, strict=False)]
        )
    page.section("Over time", _STATISTICS).plot(
        charts_plot(trend),
        "Each quantity over time within the limits of one recording; shaded on the left: the reference; "
        "vertical lines: events",
    )
    page.section("Recordings").table(
        ("recording", "date", "seconds", "out of order"),
        [
            (
                p.name,
                f"{p.date:%Y-%m-%d %H:%M}" if p.date else "–",
                f"{p.found['seconds_long']:.1f}",
                "; ".join(trend.reasons(i)) or "–",
            )
            for i, p in enumerate(trend.points)
        ],
    )
    if trend.unusable:
        page.section("Not used").table(("recording", "why"), trend.unusable)
    return page


def write_table(trend: Trend, path: Path) -> Path:
    """Write one row a recording, CSV: date, every quantity with its standard error, fits, what is outside."""
    names = [c.quantity for c in trend.charts]
    signals = list(trend.points[0].found["fit"]["estimate"])
    with path.open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream)
        head = [
            part for q in names for part in ((q.name, f"{q.name} std") if q.std is not None else (q.name,))
        ]
        table.writerow(["recording", "date", *head, *(f"fit % {s}" for s in signals), "slips", "outside"])
        for i, p in enumerate(trend.points):
            cells = [
                f"{v[i]:.9g}"
                for q in names
                for v in ((q.values, q.std) if q.std is not None else (q.values,))
            ]
            fits = [p.found["fit"]["estimate"].get(s) for s in signals]
            table.writerow(
                [
                    p.name,
                    p.date.isoformat() if p.date else "",
                    *cells,
                    *("" if f is None else f"{f:.4f}" for f in fits),
                    len(p.found["slips"]),
                    "; ".join(trend.reasons(i)),
                ]
            )
    return path
