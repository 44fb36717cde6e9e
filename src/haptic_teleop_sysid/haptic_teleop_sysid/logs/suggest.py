"""Which column is what: decided by headers alone where they leave nothing open, proposed with a measure of
certainty where names, units, ranges and the agreement between columns have to help."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.logs.by_agreement import by_agreement, nameless
from haptic_teleop_sysid.logs.derivatives import Free
from haptic_teleop_sysid.logs.guess import TimeGuess
from haptic_teleop_sysid.logs.input_column import no_input
from haptic_teleop_sysid.logs.joint_columns import joint_columns
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.proposal import STATED, Choice, Doubt, Proposal
from haptic_teleop_sysid.logs.roles import candidate, joint_names
from haptic_teleop_sysid.logs.time_column import time_column


def propose(log: Log, by_values: bool = True) -> Proposal:
    """Return the mapping that a log's columns suggest; ``by_values``: columns whose names say nothing are
    tried as derivatives of the others, too, which takes some time in a log of many."""
    opened: list[Doubt] = []
    notes: list[str] = []
    lacking: list[str] = []
    usable = [one for one in log.columns if not one.unusable]
    candidates = [c for c in map(candidate, usable) if c]
    lost = [c for c in map(candidate, [one for one in log.columns if one.unusable]) if c]
    opened += [Doubt(c.column.holds_text, column=c.column.name) for c in lost if c.column.text is not None]
    time, guess = time_column(log, candidates, lost, opened, notes)
    states = [c for c in candidates if c.role in ("position", "velocity")]
    others = [c for c in usable if time is None or c.name != time.entry.column]
    free = None
    if guess is not None and (not states or nameless(others)):
        candidates = by_agreement(others, guess.seconds)
    elif by_values:
        free = Free(others, candidates, lambda column: _seconds(log, guess, column))
        candidates = free.candidates
    states = [c for c in candidates if c.role in ("position", "velocity")]
    measured = [c for c in states if not c.command] or states
    joints: dict[str, dict[str, Choice]] = {}
    for joint in joint_names(measured) or [""]:
        draft = joint_columns(log, joint, measured, candidates, lost, guess, free)
        opened += draft.opened
        lacking += draft.lacking
        if any(name.startswith("motor") for name in draft.found):
            joints[joint or "joint"] = draft.found
    if not joints:
        empty = [c.column for c in lost if c.role in ("position", "velocity") and c.column.text is None]
        opened += [Doubt(one.unusable, column=one.name) for one in empty] or [
            Doubt("no column is a position or a velocity by its name or unit")
        ]
    if free is not None:
        alone = [c for c in joints.values() if "arm_position" not in c and "motor_position" in c]
        beside = log.find(alone[0]["motor_position"].entry.column) if len(alone) == len(joints) == 1 else None
        opened += free.unnamed(beside)
    named = {c.entry.column for signals in joints.values() for c in signals.values()}
    named |= {time.entry.column} if time else set()
    unused = [c.name for i, c in enumerate(log.columns, start=1) if c.name not in named and i not in named]
    if joints and not any("input" in signals for signals in joints.values()):
        lacking += no_input([c for c in usable if c.name in unused], lost)
    every = [c for signals in joints.values() for c in signals.values()]
    doubts = list(dict.fromkeys(opened))
    told = [d.text for d in doubts]
    for choice in [*([time] if time else []), *every]:
        if choice.sure != STATED:
            told.append(f"{choice.entry.column!r}: {'; '.join(choice.why)}")
    return Proposal(time, joints, list(dict.fromkeys(told)), unused, doubts, notes, lacking)


def _seconds(log: Log, guess: TimeGuess | None, column: Column) -> NDArray[np.float64] | None:
    """When the rows of a column are from, s; None where that is not known."""
    stamps = log.stamps.get(column.group)
    if stamps is not None:
        return (stamps - stamps[0]) * 1e-9
    return None if guess is None else guess.seconds
