"""The report of a verification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from haptic_teleop_sysid.report import Page
from haptic_teleop_sysid.verification.merit import StageMerit
from haptic_teleop_sysid.verification.pictures import latency_picture, stage_picture
from haptic_teleop_sysid.verification.run import Run
from haptic_teleop_sysid.verification.verdicts import verdicts

KeyFigure = tuple[str, str, str]


def number(value: float | None, digits: int = 3, scale: float = 1.0) -> str:
    """Return a number as text, a dash for none."""
    return "–" if value is None else f"{scale * value:.{digits}f}"


def key_figures(run: Run) -> list[KeyFigure]:
    """Return (value, what it is, what to hold it against) of the figures that tell most about a run."""
    figures: list[KeyFigure] = []
    for merit in run.merits.values():
        name = merit.stage.replace("stage", "stage ")
        if merit.free and merit.free[0].expected_speed is not None:
            motion = merit.free[0]
            figures.append((f"{motion.speed:.2f} rad/s", f"free speed, {name}", f"Td/λ {motion.expected_speed:.2f} rad/s"))
        if merit.contacts:
            contact = merit.contacts[0]
            figures.append((
                f"{contact.settled_torque:.3f} N·m", f"contact torque, {name}",
                f"Td {contact.desired_torque:.3f} N·m, overshoot {contact.overshoot_percent:.1f} %",
            ))  # fmt: skip
    for entry in run.graph["latency"][:1]:
        stamp = entry["from_stamp"]
        figures.append((f"{1e3 * stamp['p50']:.2f} ms", "loop latency, median", f"99 %: {1e3 * stamp['p99']:.2f} ms"))
    lost = sum(health["lost"] for health in run.graph["topics"].values())
    total = sum(health["messages"] for health in run.graph["topics"].values())
    figures.append((str(lost), "lost samples", f"of {total + lost}"))
    return figures


def verification_page(
    runs: Sequence[Run], labels: Sequence[str], agreements: Mapping[str, Any], remove_delay: bool = False
) -> Page:
    """Return the page: summary, each stage's pictures and figures, the graph's health, the settings and their sources."""
    kind = runs[0].experiment.get("kind")
    page = Page("Scenario 1: Omni as master, 2DSFJ as slave", ", ".join(run.name for run in runs) + (f" ({kind})" if kind else ""))
    for run, label in zip(runs, labels, strict=True):
        prefix = f"{label}: " if len(runs) > 1 else ""
        for status, text in verdicts(run):
            page.verdict(status, prefix + text)
    for figure in key_figures(runs[0]):
        page.key_figure(*figure)
    for stage in dict.fromkeys(stage for run in runs for stage in run.stages):
        _stage_section(page, runs, labels, stage, remove_delay)
    _agreement_section(page, labels, agreements)
    _graph_section(page, runs, labels)
    _settings_section(page, runs, labels)
    return page


def _stage_section(page: Page, runs: Sequence[Run], labels: Sequence[str], stage: str, remove_delay: bool) -> None:
    section = page.section(stage.replace("stage", "Stage "))
    section.picture(
        stage_picture(runs, stage, labels, remove_delay),
        "Shaded: contact and release" + (f" of {labels[0]}" if len(runs) > 1 else "") + ". Dashed: what the force law promises.",
    )
    merits = [(label, run.merits[stage]) for run, label in zip(runs, labels, strict=True) if stage in run.merits]
    section.table(
        ["run", "free from (s)", "Td (N·m)", "speed (rad/s)", "Td/λ (rad/s)", "difference (%)"],
        [[label, number(f.start, 2), number(f.desired_torque), number(f.speed), number(f.expected_speed), number(f.error_percent, 1)]
         for label, merit in merits for f in merit.free],
        "Free motion: mean speed over its last 40 %",
    )  # fmt: skip
    section.table(
        ["run", "from (s)", "Td (N·m)", "Te settled (N·m)", "error (mN·m)", "rms (mN·m)", "overshoot (%)", "settling (s)", "bounces",
         "approach (rad/s)", "release (s)"],
        [[label, number(c.start, 2), number(c.desired_torque), number(c.settled_torque, 4), number(c.settled_error, 2, 1e3),
          number(c.settled_rms, 2, 1e3), number(c.overshoot_percent, 1), number(c.settling_time, 2), c.bounces,
          number(c.approach_speed, 2), number(c.release_time, 2)]
         for label, merit in merits for c in merit.contacts],
        "Contact: settled within ±5 % of Td; error and rms over the last second",
    )  # fmt: skip
    section.table(
        ["run", "phases", "peak current (A)", "limit (A)", "at limit (%)"],
        [[label, _phases(merit), number(merit.peak_current), number(merit.current_limit, 2), number(merit.share_at_limit_percent, 2)]
         for label, merit in merits],
        "Phases found in the data, and current",
    )  # fmt: skip


def _phases(merit: StageMerit) -> str:
    return ", ".join(f"{kind} {start:.2f}–{end:.2f} s" for kind, start, end in merit.phases)


def _agreement_section(page: Page, labels: Sequence[str], agreements: Mapping[str, Any]) -> None:
    rows = [
        [label, stage, *(number(value, 1) for value in signals.values())]
        for label, stages in agreements.items()
        for stage, signals in stages.items()
    ]
    if rows:
        header = ["run", "stage", "motor position", "arm position", "motor velocity", "environment torque"]
        text = f"Fit in percent of each run to {labels[0]}, both counted from their command's onset."
        page.section("Agreement between the runs", text).table(header, rows)


def _graph_section(page: Page, runs: Sequence[Run], labels: Sequence[str]) -> None:
    section = page.section("Graph: rates, losses, latency", "All from the stamps and times of arrival in the recording.")
    section.table(
        ["run", "topic", "messages", "rate (Hz)", "lost", "repeated", "backward", "longest gap (ms)", "jitter 99 % (ms)"],
        [[label, topic, h["messages"], number(h["rate"], 1), h["lost"], h["duplicates"], h["backwards"],
          number(h["longest_gap"], 2, 1e3), number(h["jitter_p99"], 3, 1e3)]
         for run, label in zip(runs, labels, strict=True) for topic, h in run.graph["topics"].items()],
    )  # fmt: skip
    section.table(
        ["run", "command", "answered", "unanswered", "stamp to arrival, p50 / p99 / max (ms)", "arrival to arrival (ms)",
         "later than two periods (%)"],
        [[label, entry["command_topic"], entry["answered"], entry["unanswered"], _three(entry["from_stamp"]),
          _three(entry["between_arrivals"]), number(entry["late_percent"], 2)]
         for run, label in zip(runs, labels, strict=True) for entry in run.graph["latency"]],
        "Loop latency: each command bears the stamp of the state that it answers",
    )  # fmt: skip
    picture = latency_picture(runs, labels)
    if picture is not None:
        section.picture(picture, "Loop latency of the slave")


def _three(values: Mapping[str, float]) -> str:
    return " / ".join(f"{1e3 * values[key]:.2f}" for key in ("p50", "p99", "max"))


def _settings_section(page: Page, runs: Sequence[Run], labels: Sequence[str]) -> None:
    rows = []
    for run, label in zip(runs, labels, strict=True):
        for stage, merit in run.merits.items():
            for key, source in merit.settings["source"].items():
                value = merit.settings.get(key)
                rows.append([label, stage, key, "–" if value is None else f"{value:g}", source])
            rows.append([label, stage, "desired torque", "–", merit.settings["desired_torque_from"]])
    page.section("Settings, and who says so").table(["run", "stage", "setting", "value", "from"], rows)
