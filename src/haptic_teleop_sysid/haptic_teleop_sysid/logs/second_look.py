"""A proposal tried the way that `import` goes, and mended where headers contradict their own numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from haptic_teleop_control.errors import HapticTeleopError
from haptic_teleop_control.strict_yaml import parse_yaml
from haptic_teleop_sysid.logs.clock import stamps_of
from haptic_teleop_sysid.logs.convert import convert
from haptic_teleop_sysid.logs.evidence import (
    ALIKE,
    NEAR,
    Relation,
    brakes,
    derivative_relation,
    speed_of,
)
from haptic_teleop_sysid.logs.guess import PAIRS
from haptic_teleop_sysid.logs.log import Log
from haptic_teleop_sysid.logs.mapping import mapping_from
from haptic_teleop_sysid.logs.proposal import GUESSED, LIKELY, Choice, Proposal
from haptic_teleop_sysid.logs.proposal_text import mapping_text
from haptic_teleop_sysid.logs.signals import Signal, signals_of, wraps
from haptic_teleop_sysid.logs.units import unit_of

SOURCE = "the proposal"


def tried(log: Log, proposal: Proposal) -> tuple[str, list[str]]:
    """Return (why `import` would refuse the log by this proposal, "" where it takes it; what it would tell to
    look at). The proposal goes the way of a mapping file: as text, parsed, converted."""
    try:
        recording = convert(log, mapping_from(parse_yaml(mapping_text(log, proposal)), SOURCE))
    except HapticTeleopError as error:
        return " ".join(str(error).split()), []
    return "", recording.problems


def mend(log: Log, proposal: Proposal) -> bool:
    """Put units and signs into the proposal by which velocities are the derivatives of their positions, where
    the stated ones are contradicted; returns whether any was changed. They are guesses, and say why."""
    changed = False
    for choices, found in _readable(log, proposal):
        for part in ("motor", "arm"):
            pair = [found.get(f"{part}_{kind}") for kind in ("position", "velocity")]
            if pair[0] is not None and pair[1] is not None:
                related = _related(log, proposal, pair[0], pair[1])
                two = choices[f"{part}_position"], choices[f"{part}_velocity"]
                if related is not None and abs(related.alike) > ALIKE:
                    changed |= _mended(log, related, (pair[0], pair[1]), two)
    return changed


def reverse_braking(log: Log, proposal: Proposal) -> bool:
    """Reverse the sign of inputs that brake their joint on the whole, whatever headers state; returns whether
    any was."""
    changed = False
    for choices, found in _readable(log, proposal):
        drive, position = found.get("input"), found.get("motor_position")
        moved, velocity = (
            None if s is None else s.values for s in (position, found.get("motor_velocity"))
        )
        speed = speed_of(moved, velocity, moved is not None and wraps(moved) > 0)
        if drive is None or speed is None or len(drive.values) != len(speed):
            continue
        if brakes(drive.values, speed):
            drive_choice = choices["input"]
            drive_choice.entry = replace(drive_choice.entry, sign=-drive_choice.entry.sign)
            drive_choice.less(LIKELY, "it would brake the joint on the whole, so its sign is reversed")
            changed = True
    return changed


def _readable(log: Log, proposal: Proposal) -> Iterator[tuple[dict[str, Choice], dict[str, Signal]]]:
    """Choices and signals, by what they are, of each joint whose columns can be read as proposed."""
    for joint, choices in proposal.joints.items():
        try:
            yield choices, signals_of(log, joint, {n: c.entry for n, c in choices.items()}, SOURCE)
        except HapticTeleopError:
            continue


def _related(log: Log, proposal: Proposal, position: Signal, velocity: Signal) -> Relation | None:
    if len(position.values) != len(velocity.values):
        return None
    try:
        stamps, rows, _ = stamps_of(log, proposal.mapping(SOURCE), position.column, [])
    except HapticTeleopError:
        return None
    return derivative_relation((stamps - stamps[0]) * 1e-9, position.values[rows], velocity.values[rows])


def _mended(
    log: Log, related: Relation, signals: tuple[Signal, Signal], choices: tuple[Choice, Choice]
) -> bool:
    why = f"the position moves {abs(related.ratio):.4g} times as far as the integral of the velocity"
    declared = [unit_of(s.declared) for s in signals]
    changed = False
    if abs(abs(related.ratio) - 1.0) > NEAR:
        fitting = []
        for pair in PAIRS:
            units = [unit_of(name) for name in pair]
            if any(
                u is None or d is None or u.powers != d.powers for u, d in zip(units, declared, strict=True)
            ):
                continue
            scales = [u.factor / d.factor for u, d in zip(units, declared, strict=True) if u and d]
            if abs(abs(related.ratio) * scales[0] / scales[1] - 1.0) < NEAR:
                fitting.append((sum(abs(s - 1.0) > 1e-9 for s in scales), pair, scales))
        if not fitting:
            return False
        _, pair, scales = min(fitting, key=lambda f: f[0])
        for choice, signal, name, scale in zip(choices, signals, pair, scales, strict=True):
            if abs(scale - 1.0) > 1e-9:
                # By its number where its name would contradict its header.
                header = bool(signal.column.stated)
                place = log.number(signal.column) if header else choice.entry.column
                choice.entry = replace(choice.entry, column=place, unit=name)
                said = "its header says" if header else "it should be in"
                choice.less(GUESSED, f"{said} {signal.declared}, but {why}, as if it were {name}")
                changed = True
    if related.ratio < 0.0:
        choices[1].entry = replace(choices[1].entry, sign=-choices[1].entry.sign)
        choices[1].less(GUESSED, "against the position, so its sign is reversed; or the position's is")
        changed = True
    return changed
