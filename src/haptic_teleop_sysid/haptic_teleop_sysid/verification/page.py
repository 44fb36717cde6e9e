"""The report of a verification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from haptic_teleop_sysid.report import Page, Plot, Status
from haptic_teleop_sysid.verification import tables
from haptic_teleop_sysid.verification.clock import LOCKSTEP, Clock
from haptic_teleop_sysid.verification.conclusion import conclusion
from haptic_teleop_sysid.verification.energy import EXPLANATION, energy_plot, energy_table
from haptic_teleop_sysid.verification.overlay_report import Overlays, overlay_table
from haptic_teleop_sysid.verification.pictures import latency_picture
from haptic_teleop_sysid.verification.run import Run
from haptic_teleop_sysid.verification.verdicts import failures, verdicts

KeyFigure = tuple[str, str, str]


def key_figures(run: Run) -> list[KeyFigure]:
    """Return (value, what it is, what to hold it against) of the figures that tell most about a run."""
    figures: list[KeyFigure] = []
    for merit in run.merits.values():
        name = merit.title[0].lower() + merit.title[1:] if not merit.of_omni else merit.title
        if merit.free and merit.free[0].expected_speed is not None:
            motion = merit.free[0]
            figures.append(
                (
                    f"{motion.speed:.2f} rad/s",
                    f"free speed, {name}",
                    f"Td/λ {motion.expected_speed:.2f} rad/s",
                )
            )
        if merit.contacts:
            contact = merit.contacts[0]
            figures.append((
                f"{contact.settled_torque:.3f} N·m", f"contact torque, {name}",
                f"Td {contact.desired_torque:.3f} N·m, overshoot {contact.overshoot_percent:.1f} %",
            ))  # fmt: skip
    machine = run.machine
    losses = f"{machine.missing} of {machine.expected} samples missing"
    if machine.lost_on_the_way is not None:
        losses += f", {machine.lost_on_the_way} lost on the way"
    if not machine.clock.of_wall:
        figures.append(_pace(machine.clock, losses))
    elif run.graph["latency"]:
        stamp = run.graph["latency"][0]["from_stamp"]
        figures.append(
            (
                f"{1e3 * stamp['p50']:.2f} ms",
                "loop latency, median",
                f"99 %: {1e3 * stamp['p99']:.2f} ms; {losses}",
            )
        )
    else:
        figures.append(("–", "loop latency", losses))
    return figures


def _pace(clock: Clock, losses: str) -> KeyFigure:
    if clock.kind == LOCKSTEP:
        return "–", "real-time factor", f"lockstep, without a clock; {losses}"
    value = "–" if clock.achieved is None else f"{clock.achieved:.2f}"
    wanted = f"{clock.asked()}; " if clock.asked() else ""
    return value, "real-time factor", f"simulated time; {wanted}{losses}"


TITLES = {1: "Scenario 1: Omni as master, 2DSFJ as slave", 2: "Scenario 2: 2DSFJ as master, Omni as slave"}


def verification_page(
    runs: Sequence[Run],
    labels: Sequence[str],
    agreements: Mapping[str, Any],
    pictures: Mapping[str, Plot],
    overlays: Overlays,
) -> Page:
    """Return the page: the conclusion, key figures of one run or a table of several, each stage's pictures
    and figures, simulation over recording; then, folded, energies, the graph's health, the settings and their
    sources.
    """
    kind = runs[0].experiment.get("kind")
    page = Page(
        TITLES[runs[0].scenario],
        ", ".join(run.name for run in runs) + (f" ({kind})" if kind else ""),
    )
    page.conclude(*conclusion(runs, labels, list(overlays.reasons)))
    for status, text in _checks(runs, labels):
        page.verdict(status, text)
    if len(runs) > 1:
        table = tables.runs_table([run.merits for run in runs], labels)
        page.section("The runs side by side").table(*table)
    else:
        for figure in key_figures(runs[0]):
            page.key_figure(*figure)
    for stage, picture in pictures.items():
        _stage_section(page, runs, labels, stage, picture)
    _overlay_section(page, overlays)
    _agreement_section(page, labels, agreements)
    _figures_section(page, runs, labels, list(pictures))
    _energy_section(page, runs, labels)
    _graph_section(page, runs, labels)
    _settings_section(page, runs, labels)
    return page


def _checks(runs: Sequence[Run], labels: Sequence[str]) -> list[tuple[Status, str]]:
    """What failed in any of the runs, then what else is to be said of them."""
    named = [(run, f"{label}: " if len(runs) > 1 else "") for run, label in zip(runs, labels, strict=True)]
    sentences = [(prefix, failures(run)) for run, prefix in named]
    sentences += [(prefix, verdicts(run)[len(failures(run)) :]) for run, prefix in named]
    return [(status, prefix + text) for prefix, found in sentences for status, text in found]


def _stage_section(page: Page, runs: Sequence[Run], labels: Sequence[str], stage: str, picture: Plot) -> None:
    whose = f" of {labels[0]}" if len(runs) > 1 else ""
    page.section(_title(runs, stage)).plot(
        picture,
        f"{_title(runs, stage)}. Shaded: contact and release{whose}. Td and Td / λ: what the force law "
        f"promises.{f' Difference shows each run less {labels[0]}.' if len(runs) > 1 else ''}",
    )


def _title(runs: Sequence[Run], stage: str) -> str:
    return next(run.merits[stage].title for run in runs if stage in run.merits)


def _figures_section(page: Page, runs: Sequence[Run], labels: Sequence[str], stages: Sequence[str]) -> None:
    """Free motion, contacts and phases of all stages."""
    section = page.section("Motion and contact in figures")
    for stage in stages:
        named = zip(runs, labels, strict=True)
        merits = [(label, run.merits[stage]) for run, label in named if stage in run.merits]
        for header, rows, caption in (
            tables.free_table(merits),
            tables.contact_table(merits),
            tables.phase_table(merits),
        ):
            if rows:
                section.table(header, rows, f"{_title(runs, stage)}. {caption}")


def _overlay_section(page: Page, overlays: Overlays) -> None:
    if not overlays.done and not overlays.reasons:
        return
    section = page.section("Simulation and recording of the same scenario")
    for label, reason in overlays.reasons.items():
        section.text(f"No simulation lies over {label}: it {reason}.")
    for label, one in overlays.done.items():
        delay = "removed" if one.removed else "left in"
        section.text(
            f"{label}: plants from {one.plants}; command from {one.command}. The recording's command begins "
            f"{one.delay:+.3f} s against the simulation's; this delay is {delay}."
        )
    if overlays.done:
        section.table(*overlay_table(overlays.done))
    for label in overlays.done:
        for group, picture in overlays.pictures[label].items():
            page.section(f"{group.capitalize()}: {label} and its simulation", folded=True).plot(
                picture, f"{label}, {group}: recording and simulation"
            )


def _agreement_section(page: Page, labels: Sequence[str], agreements: Mapping[str, Any]) -> None:
    if any(agreements.values()):
        text = f"Fit in percent of each run to {labels[0]}, both counted from their command's onset."
        page.section("Agreement between the runs", text).table(*tables.agreement_table(agreements))


def _energy_section(page: Page, runs: Sequence[Run], labels: Sequence[str]) -> None:
    plot = energy_plot(runs[0].energies)
    if plot is not None:
        section = page.section("Energy at the ports", EXPLANATION, folded=True)
        section.plot(plot, f"Energy, {labels[0]}")
        section.table(*energy_table([run.energies for run in runs], labels))


def _graph_section(page: Page, runs: Sequence[Run], labels: Sequence[str]) -> None:
    text = (
        "From the stamps and times of arrival in the recording. Missing are the samples that the rate would "
        "have had. The recorder counts, by the publishers' own numbers, how many of them were published and "
        "lost on the way to it; the others were never taken, because the computer was late."
    )
    if not all(run.machine.clock.of_wall for run in runs):
        text += (
            " In simulated time and in lockstep nothing is late: rates count simulated seconds, and an "
            "answer takes none, so that there is no latency to tell."
        )
    section = page.section("Graph: rates, missing samples, latency", text, folded=True)
    section.table(*tables.topic_table(runs, labels)).table(*tables.latency_table(runs, labels))
    picture = latency_picture(runs, labels)
    if picture is not None:
        section.picture(picture, "Loop latency of the slave")


def _settings_section(page: Page, runs: Sequence[Run], labels: Sequence[str]) -> None:
    section = page.section("Settings and their source", folded=True)
    section.table(*tables.settings_table(runs, labels))
