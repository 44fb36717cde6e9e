"""Which column is what: decided by headers alone where they leave nothing open, proposed with a measure of
certainty where names, units, ranges and the agreement between columns have to help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.logs.by_agreement import by_agreement, nameless
from haptic_teleop_sysid.logs.derivatives import Free
from haptic_teleop_sysid.logs.evidence import still
from haptic_teleop_sysid.logs.guess import TimeGuess, guess_time, guess_units
from haptic_teleop_sysid.logs.headers import unknown_unit
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.mapping import Entry
from haptic_teleop_sysid.logs.proposal import FILL, GUESSED, LIKELY, MISSING, STATED, Choice, Doubt, Proposal
from haptic_teleop_sysid.logs.roles import (
    Candidate,
    candidate,
    counts_rows,
    input_unit_by_name,
    joint_names,
    says_nothing,
)
from haptic_teleop_sysid.logs.units import SHARE, unit_of

#: Share of the rows that a time has to differ from the row before.
_SELDOM = 0.01
#: Columns that are offered where none is an input by its name.
_FEW = 6


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
    time, guess = _time(log, candidates, lost, opened, notes)
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
        found = _joint(log, joint, measured, candidates, lost, guess, opened, lacking, free)
        if any(name.startswith("motor") for name in found):
            joints[joint or "joint"] = found
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
        lacking += _no_input([c for c in usable if c.name in unused], lost)
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


def _time(
    log: Log,
    candidates: Sequence[Candidate],
    lost: Sequence[Candidate],
    opened: list[Doubt],
    notes: list[str],
) -> tuple[Choice | None, TimeGuess | None]:
    if log.stamps:
        return None, None
    found = [c for c in candidates if c.role == "time"]
    found = [c for c in found if not _dates_alone(c.column)] or found
    stated = [c for c in found if c.stated]
    if len(found) > 1:
        names = " and ".join(repr(c.column.name) for c in found)
        same = _same_clock(stated) if len(stated) == len(found) else False
        if same:
            notes.append(f"{names} tell the same time: the one with more digits is taken")
            found = stated = [max(stated, key=lambda c: len(np.unique(c.column.values)))]
        else:
            opened.append(Doubt(f"{names} may each be the time", signal="time"))
    if not found:
        first = [c for c in log.columns if not counts_rows(c) and guess_time(c.values, "") is not None]
        if not first:
            told = "no column is a time by its name, unit or values: give time: {rate: HZ}"
            opened.append(Doubt(told, signal="time"))
            return None, None
        guess = guess_time(first[0].values, "")
        assert guess is not None
        choice = Choice(
            replace(_entry(log, first[0]), unit=guess.unit), GUESSED, [f"it goes up evenly; {guess.why}"]
        )
        return choice, guess
    chosen = (stated or found)[0]
    guess = guess_time(chosen.column.values, chosen.column.known)
    if chosen.stated:
        choice = Choice(_entry(log, chosen.column), STATED, ["its unit is one of time"])
        if len(found) > 1:
            choice.less(GUESSED, "another column may be the time as well")
        for rival in lost:
            if rival.role == "time" and rival.stated:
                choice.less(GUESSED, _left_over(rival))
        return choice, guess
    if guess is None:
        return Choice(
            Entry(chosen.column.name, "s"), MISSING, ["its values do not go up: give the unit"]
        ), None
    return Choice(Entry(chosen.column.name, guess.unit), guess.sure, [guess.why]), guess


def _dates_alone(column: Column) -> bool:
    """Whether a column hardly ever changes, as the date does beside a time of day."""
    return float(np.mean(np.diff(column.values) != 0.0)) < _SELDOM if len(column.values) > 1 else False


def _entry(log: Log, column: Column) -> Entry:
    """The entry of a column, by its number where others have its name."""
    if sum(c.name == column.name for c in log.columns) == 1:
        return Entry(column.name)
    return Entry(log.number(column), column.known)


def _same_clock(clocks: Sequence[Candidate]) -> bool:
    """Whether columns of time tell the same but for their start, to a tenth of a period."""

    times = []
    for c in clocks:
        unit = unit_of(c.column.known)
        assert unit is not None
        times.append((c.column.values - c.column.values[0]) * unit.factor)
    period = float(np.median(np.abs(np.diff(times[0])))) or 1.0
    return all(
        len(t) == len(times[0]) and float(np.nanmax(np.abs(t - times[0]))) < max(0.1 * period, 1e-9)
        for t in times
    )


def _joint(
    log: Log,
    joint: str,
    states: Sequence[Candidate],
    candidates: Sequence[Candidate],
    lost: Sequence[Candidate],
    time: TimeGuess | None,
    opened: list[Doubt],
    lacking: list[str],
    free: Free | None,
) -> dict[str, Choice]:
    own = _of_one_group([c for c in states if c.joint == joint], joint, opened)
    found: dict[str, Choice] = {}
    chosen: dict[str, Candidate] = {}
    rivals = [c for c in lost if c.joint == joint and c.role in ("position", "velocity") and not c.command]
    for role in ("position", "velocity"):
        _parts(log, role, joint, [c for c in own if c.role == role], rivals, found, chosen, opened)
    if free is not None:
        _by_values(log, joint, free, found, chosen, opened)
    _input(log, joint, candidates, lost, states, found, chosen, opened)
    motors: list[Candidate] = []
    if not any(name.startswith("motor") for name in found):
        arms = any(name.startswith("arm") for name in found)
        motors = [c for c in rivals if c.part != "arm"] if arms else []
        for role in () if motors else ("position", "velocity"):
            if f"arm_{role}" in found:  # one encoder, whatever it is called, is the joint's
                found[f"motor_{role}"] = found.pop(f"arm_{role}")
                chosen[f"motor_{role}"] = chosen.pop(f"arm_{role}")
    guess_units(log, chosen, found, time)
    for name, choice in found.items():
        column = chosen[name].column if name in chosen else None
        if column is None:
            continue
        unit, kind = unit_of(column.known), name.rpartition("_")[2]
        if not column.known and (other := unknown_unit(column.name)):
            choice.less(MISSING, f"its header says {other!r}, which is no unit that is known here")
            choice.entry = replace(choice.entry, unit="")
        elif unit is not None and unit.quantity == SHARE and kind != "input":
            choice.less(MISSING, f"its header says {column.known!r}: of what? give gain and gain_unit, too")
    for rival in motors[:1]:  # what is the arm's is not the motor's because the motor's is lost
        found[f"motor_{rival.role}"] = Choice(Entry(FILL), MISSING, [rival.column.unusable])
        lacking += [] if rival.column.text is not None else [_no_motor(rival, chosen)]
    return found


def _left_over(rival: Candidate) -> str:
    """What is said of an entry whose column was taken because a likelier one cannot be."""
    return f"taken because {rival.column.unusable}"


def _no_motor(lost: Candidate, chosen: dict[str, Candidate]) -> str:
    """What is said where the motor's column holds no number."""
    arm = next(c.column.name for name, c in chosen.items() if name.startswith("arm"))
    return (
        f"{lost.column.unusable}, and is the motor's {lost.role} by its name: record it; if {arm!r} is the "
        "joint's only encoder, give it in a mapping as the motor's"
    )


def _no_input(unused: Sequence[Column], lost: Sequence[Candidate]) -> list[str]:
    """What is said where no joint has an input and none of the other columns could be one; else nothing."""
    for column in unused:
        other = candidate(column)
        could_be = says_nothing(column) if other is None else other.role == "input"
        if could_be and not counts_rows(column) and not still(column.values):
            return []
    empty = [c.column.unusable for c in lost if c.role == "input"]
    why = f" ({empty[0]})" if empty else ""
    what = "torque, force, current, voltage, PWM"
    moving = [
        repr(c.name) for c in unused if candidate(c) is None and not counts_rows(c) and not still(c.values)
    ]
    if moving and not why:
        return [
            f"there is no column that could be the input ({what}) by its name: if "
            f"{' or '.join(moving[:_FEW])} drives the joint, give it in a mapping; else record it"
        ]
    return [f"there is no column that could be the input ({what}){why}: record it"]


def _by_values(
    log: Log,
    joint: str,
    free: Free,
    found: dict[str, Choice],
    chosen: dict[str, Candidate],
    opened: list[Doubt],
) -> None:
    """Give what lacks a velocity or a position the free column that is its derivative or integral."""
    for part in ("motor", "arm"):
        for have, lack in (("position", "velocity"), ("velocity", "position")):
            if f"{part}_{have}" not in chosen or f"{part}_{lack}" in chosen:
                continue
            known = chosen[f"{part}_{have}"].column
            pair = free.velocity_of(known) if have == "position" else free.position_of(known)
            if pair is None:
                continue
            column = pair.velocity if have == "position" else pair.position
            free.use(column)
            name = f"{part}_{lack}"
            why = f"{part} {lack} by its values: {pair.told}"
            chosen[name] = Candidate(column, lack, part, joint, False, False, False, why)
            found[name] = Choice(_entry(log, column), LIKELY, [why])
    taken = {name: candidate.column for name, candidate in chosen.items()}
    opened += free.doubts(joint or "joint", taken)


def _of_one_group(own: list[Candidate], joint: str, opened: list[Doubt]) -> list[Candidate]:
    """The candidates that share their rows: those of joint states, or of the group that has most."""
    groups = list(dict.fromkeys(c.column.group for c in own))
    if len(groups) < 2:
        return own
    best = max(groups, key=lambda g: ("joint_states" in g, sum(c.column.group == g for c in own)))
    others = ", ".join(g for g in groups if g != best)
    told = f"{others} may be of {joint or 'the joint'} as well as {best}"
    opened.append(Doubt(told, joint or "joint"))
    return [c for c in own if c.column.group == best]


def _parts(
    log: Log,
    role: str,
    joint: str,
    own: list[Candidate],
    rivals: Sequence[Candidate],
    found: dict[str, Choice],
    chosen: dict[str, Candidate],
    opened: list[Doubt],
) -> None:
    """Motor and arm among the candidates of one role; ``rivals``: columns that would be, and hold no
    numbers."""
    lost = [c for c in rivals if c.role == role]
    by_part = {part: [c for c in own if c.part == part] for part in ("motor", "arm", "")}
    for part in ("motor", "arm"):
        if len(by_part[part]) > 1:
            names = " and ".join(repr(c.column.name) for c in by_part[part])
            told = f"{names} may each be the {role} of the {part}"
            opened.append(Doubt(told, joint or "joint", f"{part}_{role}"))
    rest = list(by_part[""])
    doubtful = len(rest) > 1 or (bool(rest) and bool(by_part["motor"]))
    for part in ("motor", "arm"):
        if by_part[part]:
            pick = by_part[part][0]
        elif rest and (part == "motor" or by_part["motor"] or len(by_part[""]) > 1):
            pick = rest.pop(0)
        else:
            continue
        choice = Choice(
            _entry(log, pick.column),
            STATED if pick.stated else LIKELY,
            [f"{part} {pick.why or f'{role} by its name'}"],
        )
        if not pick.part and doubtful:
            choice.less(GUESSED, f"nothing says whether it is the motor's or the arm's {role}")
        elif not pick.part and part == "arm":
            choice.less(GUESSED, "the one that is not the motor's")
        if len(by_part[part]) > 1:
            choice.less(GUESSED, "the first of several")
        rival = next((c for c in lost if not pick.part and c.part in (part, "")), None)
        if rival is not None:
            choice.less(GUESSED, _left_over(rival))
        found[f"{part}_{role}"], chosen[f"{part}_{role}"] = choice, pick
    if rest:
        opened += [Doubt(f"{c.column.name!r} may be a {role}, too", column=c.column.name) for c in rest]


def _input(
    log: Log,
    joint: str,
    candidates: Sequence[Candidate],
    lost: Sequence[Candidate],
    states: Sequence[Candidate],
    found: dict[str, Choice],
    chosen: dict[str, Candidate],
    opened: list[Doubt],
) -> None:
    alone = len({c.joint for c in states}) == 1
    beside = [c for c in lost if c.role in ("position", "velocity") and c.joint != joint]
    rivals = [c for c in lost if c.role == "input" and (c.joint == joint or alone)]
    own = [c for c in candidates if c.role == "input" and (c.joint == joint or (alone and not c.joint))]
    if alone and not own:
        own = [c for c in candidates if c.role == "input"]
    if not own:
        told = f"no column is the input (torque, force, current, voltage) of {joint or 'the joint'}"
        opened.append(Doubt(told, joint or "joint", "input"))
        return
    rank = {"N*m": 0, "N": 0, "A": 1, "V": 2}
    groups = {c.column.group for n, c in chosen.items()}

    def order(c: Candidate) -> tuple[int | bool, ...]:
        named = input_unit_by_name(c.column)
        pushes = bool(log.stamps) and (c.column.known or named) == "N"  # the joints of ROS mostly turn
        asked = 0 if c.measured else 2 if c.command else 1
        idle = not c.column.unusable and still(c.column.values)
        return idle, c.column.group not in groups, pushes, rank.get(named, 0), asked

    pick = min(own, key=order)
    sure = STATED if pick.stated else GUESSED if pick.why else LIKELY
    choice = Choice(_entry(log, pick.column), sure, [pick.why or "input by its name"])
    if still(pick.column.values) and not pick.stated:
        choice.less(GUESSED, "it is constant: a joint is identified by an input that changes")
    if log.stamps and pick.column.group not in groups:
        choice.less(GUESSED, f"of {pick.column.group}: nothing says that it drives this joint")
    if rivals and order(best := min(rivals, key=order)) <= order(pick):
        choice.less(GUESSED, _left_over(best))
    if alone and beside and pick.joint != joint:
        choice.less(GUESSED, f"it may drive another joint, for {beside[0].column.unusable}")
    if len(own) > 1:
        names = ", ".join(repr(c.column.name) for c in own if c is not pick)
        told = f"{names} may be the input as well as {pick.column.name!r}"
        opened.append(Doubt(told, joint or "joint", "input"))
        choice.less(LIKELY, f"{names} may be it, too")
    found["input"], chosen["input"] = choice, pick
