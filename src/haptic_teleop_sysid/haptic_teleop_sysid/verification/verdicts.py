"""What the figures mean, in sentences, with the bounds they are held against."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from haptic_teleop_sysid.report.page import Status
from haptic_teleop_sysid.verification.contact import HELD_SECONDS, Contact
from haptic_teleop_sysid.verification.machine import LINK, LOST_SHARE
from haptic_teleop_sysid.verification.merit import FreeMotion, StageMerit
from haptic_teleop_sysid.verification.oscillation import Oscillation
from haptic_teleop_sysid.verification.run import Run

SPEED_PERCENT = 10.0
"""Friction lets the speed droop below Td/λ by about 6 % in simulation of the two stages."""
TORQUE_SHARE = 0.05
OVERSHOOT_PERCENT = 30.0
"""The impact of stage 1 on a stiff wall gives 20 to 27 %."""


def verdicts(run: Run) -> list[tuple[Status, str]]:
    """Return (status, sentence) for each thing worth saying about a run, most important first: the failures
    of `failures`, what the robots did, what the computer did."""
    found = failures(run)
    moved = any(merit.free or merit.contacts for merit in run.merits.values())
    for merit in run.merits.values():
        name = merit.title
        if not merit.free and not merit.contacts:
            status: Status = "plain" if moved else "bad"  # a scenario may well move one stage only
            found.append(
                (status, f"{name}: no command was given, or it did nothing that can be told from rest.")
            )
            continue
        found += [_free(name, motion) for motion in merit.free]
        by = " an estimated" if merit.of_omni else ""
        found += [_contact(name, contact, by) for contact in merit.contacts]
        if not merit.contacts and merit.oscillation is None:  # else nothing tells a wall from its swinging
            found.append(("fair", f"{name} met no wall."))
        found.append(_current(name, merit))
    found += run.machine.lines()
    return found + _graph(run)


def failures(run: Run) -> list[tuple[Status, str]]:
    """Return (status, sentence) of what makes a run a failure: faults in the order in which they came, what
    is missing of the recording, then the stages that oscillate."""
    found: list[tuple[Status, str]] = [("bad", f"Fault in {fault.in_words()}") for fault in run.faults]
    if run.cut_off:
        found.append(("bad", f"The run was {run.cut_off}: what follows is judged by that part."))
    if not run.complete:
        found.append(("bad", "The recording is damaged: " + "; ".join(run.problems) + "."))
    for merit in run.merits.values():
        if merit.oscillation is not None:
            found.append(("bad", _oscillates(merit.title, merit.oscillation)))
    return found


def _oscillates(name: str, one: Oscillation) -> str:
    what = {
        "limits": f"its current jumps between its limits of ±{one.amplitude:.3g} {one.unit}",
        "velocity": f"its velocity swings by ±{one.amplitude:.3g} {one.unit}",
        "torque": f"its torque on the environment swings by ±{one.amplitude:.3g} {one.unit}",
        "current": f"its current swings by ±{one.amplitude:.3g} {one.unit}",
    }[one.kind]
    return (
        f"{name} oscillates: {what} at {one.frequency:.1f} Hz for {one.share_percent:.0f} % of the time, "
        f"between {one.start:.2f} and {one.end:.2f} s, without being asked to: lower the gains."
    )


def _free(name: str, motion: FreeMotion) -> tuple[Status, str]:
    where = f"{name} in free motion from {motion.start:.2f} s"
    if motion.expected_speed is None or motion.error_percent is None:
        return (
            "plain",
            f"{where} moves at {motion.speed:.3f} rad/s; λ is not known, so nothing tells what it should be.",
        )
    if not motion.steady:
        return "plain", f"{where} reaches {motion.speed:.3f} rad/s and is still changing when it ends."
    status: Status = "good" if abs(motion.error_percent) <= SPEED_PERCENT else "fair"
    return status, (
        f"{where} moves at {motion.speed:.3f} rad/s; Td/λ is {motion.expected_speed:.3f} rad/s "
        f"({motion.error_percent:+.1f} %, at most ±{SPEED_PERCENT:g} % expected)."
    )


def _contact(name: str, contact: Contact, by: str = "") -> tuple[Status, str]:
    if contact.by_hand:
        return _contact_by_hand(name, contact, by)
    if contact.cut_off:
        return "fair", (
            f"{name} meets the wall at {contact.start:.2f} s, {_bounces(contact)}, and has not settled when "
            f"the recording ends {contact.duration:.2f} s later: record for longer."
        )
    settled = contact.settling_time is not None
    accurate = abs(contact.settled_error) <= TORQUE_SHARE * abs(contact.desired_torque)
    calm = contact.overshoot_percent <= OVERSHOOT_PERCENT
    status: Status = "bad" if not (settled and accurate) else ("good" if calm else "fair")
    when = (
        f"within ±5 % after {contact.settling_time:.2f} s"
        if contact.settling_time is not None
        else "it does not settle"
    )
    return status, (
        f"{_pressing(name, contact, by)}; {when}, overshoot {contact.overshoot_percent:.1f} %, "
        f"{_bounces(contact)}."
    )


def _contact_by_hand(name: str, contact: Contact, by: str) -> tuple[Status, str]:
    """What the hand asks for changes all the time, and at the end it draws back: only while it holds still
    can be told whether the contact presses as it is asked to."""
    if contact.held is None:
        return "plain", (
            f"{name} in contact from {contact.start:.2f} s is not judged: a hand leads, and never asks for "
            f"the same for {HELD_SECONDS:g} s."
        )
    accurate = abs(contact.settled_error) <= TORQUE_SHARE * abs(contact.desired_torque)
    calm = contact.overshoot_percent <= OVERSHOOT_PERCENT
    start, end = contact.held
    return "bad" if not accurate else ("good" if calm else "fair"), (
        f"{_pressing(name, contact, by)} while the hand that leads holds still, {start:.2f} to {end:.2f} s; "
        f"before that at most {contact.overshoot_percent:.1f} % more than is asked for at the time, "
        f"{_bounces(contact)}."
    )


def _pressing(name: str, contact: Contact, by: str) -> str:
    error = round(1e3 * contact.settled_error, 2) + 0.0  # no -0.00
    return (
        f"{name} in contact from {contact.start:.2f} s presses with{by} {contact.settled_torque:.4f} N·m of "
        f"{contact.desired_torque:.4f} N·m asked ({error:+.2f} mN·m, rms {1e3 * contact.settled_rms:.2f})"
    )


def _bounces(contact: Contact) -> str:
    times = {1: "once", 2: "twice"}.get(contact.bounces, f"{contact.bounces} times")
    return f"bounces {times}, by {1e3 * contact.rebound:.0f} mrad" if contact.bounces else "no bounce"


def _current(name: str, merit: StageMerit) -> tuple[Status, str]:
    text = f"{name} draws at most {merit.peak_current:.3f} {merit.unit} as measured"
    if merit.peak_commanded_current is not None:
        text += f", is asked for at most {merit.peak_commanded_current:.3f} {merit.unit}"
    if merit.share_at_limit_percent > 0.0:
        return (
            "plain",
            f"{text} and is at its limit of {merit.current_limit:g} {merit.unit} for "
            f"{merit.share_at_limit_percent:.2f} % of the time.",
        )
    return "good", f"{text} (limit {merit.current_limit:g} {merit.unit})."


def _missing(health: Mapping[str, Any], share: float) -> str:
    missing, on_the_way = health["lost"], health["lost_on_the_way"]
    if not missing and not on_the_way:
        return "no sample missing"
    what = f"{missing} {'sample' if missing == 1 else 'samples'} missing ({100 * share:.2g} %)"
    if on_the_way is None:
        return f"{what}, never taken or lost on the way"
    return f"{what}: {max(0, missing - on_the_way)} never taken, {on_the_way} lost on the way to the recorder"


def _graph(run: Run) -> list[tuple[Status, str]]:
    found: list[tuple[Status, str]] = []
    for topic, health in run.graph["topics"].items():
        share = health["lost"] / max(1, health["messages"] + health["lost"])
        status: Status = "good" if share == 0.0 else ("fair" if share <= LOST_SHARE else "bad")
        if topic.startswith(LINK) and health["lost"]:
            status = "plain"
        rate = "Hz achieved" if run.machine.clock.of_wall else "Hz, by its stamps"
        found.append((status, f"{topic}: {health['rate']:.1f} {rate}, {_missing(health, share)}."))
    for entry in run.graph["latency"]:
        period = run.graph["topics"].get(entry["state_topic"], {}).get("period")
        stamp = entry["from_stamp"]
        if stamp is None:
            found.append(_answered(entry))
            continue
        status = "good" if entry["late_percent"] <= 1.0 else "fair"
        late = (
            f"{entry['late_percent']:.2f} % later than two periods of {1e3 * period:.3g} ms" if period else ""
        )
        missing = (
            f", {entry['unanswered']} states unanswered" if entry["unanswered"] else ", every state answered"
        )
        found.append((
            status,
            f"{entry['command_topic']} answers {1e3 * stamp['p50']:.2f} ms (median), "
            f"{1e3 * stamp['p99']:.2f} ms (99 %), "
            f"{1e3 * stamp['max']:.2f} ms (most) after the state's stamp; {late}{missing}.",
        ))  # fmt: skip
    return found


def _answered(entry: Mapping[str, Any]) -> tuple[Status, str]:
    """Where an answer takes no time."""
    pair = f"{entry['command_topic']} answers {entry['state_topic']}"
    if entry["unanswered"]:
        return "bad", f"{pair}: {entry['unanswered']} states unanswered."
    return "good", f"{pair}: every state answered."
