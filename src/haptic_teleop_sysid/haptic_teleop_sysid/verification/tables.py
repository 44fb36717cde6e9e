"""The tables of a verification report: (header, rows, caption) each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from haptic_teleop_sysid.verification.merit import StageMerit
from haptic_teleop_sysid.verification.run import Run

Table = tuple[list[str], list[list[object]], str]
SETTING_UNITS: dict[str, str | None] = {
    "lambda": "N·m·s/rad",
    "torque_gain": "N·m/rad",
    "neutral": "rad",
    "wall": "rad",
    "stiffness": "N·m/rad",
    "torque_constant": "N·m/A",
    "current_limit": None,
}
"""Unit of each setting of a stage; None: that of what limits its motor."""
Named = Sequence[tuple[str, StageMerit]]


def number(value: float | None, digits: int = 3, scale: float = 1.0) -> str:
    """Return a number as text, a dash for none."""
    # Adding zero turns a rounded -0.0 into 0.0.
    return "–" if value is None else f"{round(scale * value, digits) + 0.0:.{digits}f}"


def runs_table(merits: Sequence[Mapping[str, StageMerit]], labels: Sequence[str]) -> Table:
    """Several runs side by side, stage by stage: the figures of their first free motion and first contact."""
    header = ["stage", "run", "free speed (rad/s)", "contact torque (N·m)", "of Td (N·m)"]
    header += ["overshoot (%)", "settling (s)"]
    rows: list[list[object]] = []
    for stage in dict.fromkeys(stage for one in merits for stage in one):
        for found, label in zip(merits, labels, strict=True):
            if (merit := found.get(stage)) is None:
                continue
            free = merit.free[0] if merit.free else None
            contact = merit.contacts[0] if merit.contacts else None
            row = [number(free.speed if free else None)]
            if contact is None:
                row += 4 * ["–"]
            else:
                row += [number(contact.settled_torque), number(contact.desired_torque)]
                row += [number(contact.overshoot_percent, 1), number(contact.settling_time, 2)]
            rows.append([merit.title, label, *row])
    return header, rows, "First free motion and first contact of each run"


def free_table(merits: Named) -> Table:
    """Free motions."""
    header = ["run", "free from (s)", "Td (N·m)", "speed (rad/s)", "Td/λ (rad/s)", "difference (%)", "steady"]
    rows: list[list[object]] = []
    for label, merit in merits:
        for f in merit.free:
            speeds = [number(f.speed), number(f.expected_speed), number(f.error_percent, 1)]
            steady = "yes" if f.steady else "no"
            rows.append([label, number(f.start, 2), number(f.desired_torque), *speeds, steady])
    return header, rows, "Free motion: mean speed over its last 0.1 s"


def contact_table(merits: Named) -> Table:
    """Contacts."""
    header = [
        "run",
        "from (s)",
        "Td (N·m)",
        "Te settled (N·m)",
        "error (mN·m)",
        "rms (mN·m)",
        "overshoot (%)",
    ]
    header += ["settling (s)", "bounces", "rebound (mrad)", "approach (rad/s)", "release (s)"]
    rows: list[list[object]] = []
    for label, merit in merits:
        for c in merit.contacts:
            torques = [number(c.desired_torque), number(c.settled_torque, 4)]
            errors = [number(c.settled_error, 2, 1e3), number(c.settled_rms, 2, 1e3)]
            transient = [number(c.overshoot_percent, 1), number(c.settling_time, 2)]
            transient += [str(c.bounces), number(c.rebound, 1, 1e3)]
            ends = [number(c.approach_speed, 2), number(c.release_time, 2)]
            rows.append([label, number(c.start, 2), *torques, *errors, *transient, *ends])
    caption = "Contact: settled within ±5 % of Td; error and rms over the last second"
    if any(c.by_hand for _, merit in merits for c in merit.contacts):
        caption += "; where a hand leads, of the longest stretch in which it holds still, and overshoot is "
        caption += "what exceeds Td at the time"
    return header, rows, caption


def phase_table(merits: Named) -> Table:
    """Phases and currents."""
    what = "torque (N·m)" if any(merit.of_omni for _, merit in merits) else "current (A)"
    header = ["run", "phases", f"peak {what}", f"limit ({what.split('(')[1]}", "at limit (%)"]
    rows: list[list[object]] = []
    for label, merit in merits:
        phases = ", ".join(f"{kind} {start:.2f}–{end:.2f} s" for kind, start, end in merit.phases)
        limits = [number(merit.current_limit, 2), number(merit.share_at_limit_percent, 2)]
        rows.append([label, phases, number(merit.peak_current), *limits])
    return header, rows, "Phases found in the data, and current"


def topic_table(runs: Sequence[Run], labels: Sequence[str]) -> Table:
    """Rates and losses of every topic."""
    header = ["run", "topic", "messages", "rate (Hz)", "missing", "lost on the way", "repeated"]
    header += ["backward", "longest gap (ms)", "jitter 99 % (ms)"]
    rows: list[list[object]] = []
    for run, label in zip(runs, labels, strict=True):
        for topic, health in run.graph["topics"].items():
            way = health["lost_on_the_way"]
            lost = [health["lost"], "unknown" if way is None else way]
            counts = [*lost, health["duplicates"], health["backwards"]]
            times = [number(health["longest_gap"], 2, 1e3), number(health["jitter_p99"], 3, 1e3)]
            rows.append([label, topic, health["messages"], number(health["rate"], 1), *counts, *times])
    return header, rows, ""


def latency_table(runs: Sequence[Run], labels: Sequence[str]) -> Table:
    """Loop latencies."""
    header = ["run", "command", "answered", "unanswered", "stamp to arrival, p50 / p99 / max (ms)"]
    header += ["arrival to arrival (ms)", "later than two periods (%)"]
    rows: list[list[object]] = []
    for run, label in zip(runs, labels, strict=True):
        for entry in run.graph["latency"]:
            times = [_three(entry["from_stamp"]), _three(entry["between_arrivals"])]
            counts = [entry["answered"], entry["unanswered"]]
            rows.append([label, entry["command_topic"], *counts, *times, number(entry["late_percent"], 2)])
    return header, rows, "Loop latency: each command bears the stamp of the state that it answers"


def settings_table(runs: Sequence[Run], labels: Sequence[str]) -> Table:
    """Settings of each stage with their units and sources."""
    rows: list[list[object]] = []
    for run, label in zip(runs, labels, strict=True):
        for merit in run.merits.values():
            for key, source in merit.settings["source"].items():
                value, unit = merit.settings.get(key), SETTING_UNITS[key]
                unit = merit.unit if unit is None else unit
                rows.append([label, merit.title, key, "–" if value is None else f"{value:g}", unit, source])
            made = merit.settings["desired_torque_from"]
            rows.append([label, merit.title, "desired torque", "–", "N·m", made])
    return ["run", "stage", "setting", "value", "unit", "source"], rows, ""


def agreement_table(agreements: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Table:
    """How far the runs agree with the first."""
    header = ["run", "stage", "motor position", "arm position", "motor velocity", "environment torque"]
    rows: list[list[object]] = [
        [label, stage, *(number(value, 1) for value in signals.values())]
        for label, stages in agreements.items()
        for stage, signals in stages.items()
    ]
    return header, rows, ""


def _three(values: Mapping[str, float] | None) -> str:
    if values is None:
        return "–"
    return " / ".join(f"{1e3 * values[key]:.2f}" for key in ("p50", "p99", "max"))
