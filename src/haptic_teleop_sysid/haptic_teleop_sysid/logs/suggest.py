"""Which column is what: decided by headers alone where they leave nothing open, proposed with a measure of
certainty where names, units, ranges and the agreement between columns have to help."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from haptic_teleop_sysid.logs.by_agreement import by_agreement, nameless
from haptic_teleop_sysid.logs.evidence import still
from haptic_teleop_sysid.logs.guess import TimeGuess, guess_time, guess_units
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.mapping import Entry, Mapping
from haptic_teleop_sysid.logs.roles import Candidate, candidate, counts_rows, input_unit_by_name, joint_names
from haptic_teleop_sysid.logs.units import unit_of

STATED, LIKELY, GUESSED, MISSING = "stated", "likely", "guessed", "missing"
"""How sure a proposal is of an entry: the header says it, good evidence, little evidence, to be filled in."""


@dataclass
class Choice:
    """An entry, how sure it is, and why."""

    entry: Entry
    sure: str
    why: list[str] = field(default_factory=list)

    def less(self, sure: str, why: str) -> None:
        """Lower the certainty, never raise it."""
        order = (STATED, LIKELY, GUESSED, MISSING)
        self.sure = max(self.sure, sure, key=order.index)
        self.why.append(why)


@dataclass
class Proposal:
    """A mapping that was found: ``time`` (None where the log's own stamps count), ``joints``: name -> signal
    -> Choice; ``open``: what headers leave open, in sentences, ``doubts`` those of
    them that no entry tells of; ``unused``: columns that no entry names; ``notes``: what was settled without
    being open."""

    time: Choice | None
    joints: dict[str, dict[str, Choice]]
    open: list[str]
    unused: list[str]
    doubts: list[str]
    notes: list[str]

    @property
    def usable(self) -> bool:
        """Whether a recording can be made of it without anything being filled in."""
        every = [c for signals in self.joints.values() for c in signals.values()]
        return bool(self.joints) and all(
            c.sure != MISSING for c in [*every, *([self.time] if self.time else [])]
        )

    def mapping(self, source: str) -> Mapping:
        """The mapping that it proposes."""
        joints = {j: {n: c.entry for n, c in signals.items()} for j, signals in self.joints.items()}
        return Mapping(joints, None if self.time is None else self.time.entry, source=source)


def propose(log: Log) -> Proposal:
    """Return the mapping that a log's columns suggest."""
    opened: list[str] = []
    notes: list[str] = []
    usable = [one for one in log.columns if one.text is None and np.any(np.isfinite(one.values))]
    candidates = [c for c in map(candidate, usable) if c]
    for one in log.columns:
        if one.text is not None and candidate(one) is not None:
            opened.append(one.holds_text)
    time, guess = _time(log, candidates, opened, notes)
    states = [c for c in candidates if c.role in ("position", "velocity")]
    others = [c for c in usable if time is None or c.name != time.entry.column]
    if guess is not None and (not states or nameless(others)):
        candidates = by_agreement(others, guess.seconds)
        states = [c for c in candidates if c.role in ("position", "velocity")]
    measured = [c for c in states if not c.command] or states
    joints: dict[str, dict[str, Choice]] = {}
    for joint in joint_names(measured) or [""]:
        found = _joint(log, joint, measured, candidates, guess, opened)
        if any(name.startswith("motor") for name in found):
            joints[joint or "joint"] = found
    if not joints:
        opened.append("no column is a position or a velocity by its name or unit")
    named = {c.entry.column for signals in joints.values() for c in signals.values()}
    named |= {time.entry.column} if time else set()
    unused = [c.name for c in log.columns if c.name not in named]
    every = [c for signals in joints.values() for c in signals.values()]
    doubts = list(dict.fromkeys(opened))
    for choice in [*([time] if time else []), *every]:
        if choice.sure != STATED:
            opened.append(f"{choice.entry.column!r}: {'; '.join(choice.why)}")
    return Proposal(time, joints, list(dict.fromkeys(opened)), unused, doubts, notes)


def _time(
    log: Log, candidates: Sequence[Candidate], opened: list[str], notes: list[str]
) -> tuple[Choice | None, TimeGuess | None]:
    if log.stamps:
        return None, None
    found = [c for c in candidates if c.role == "time"]
    stated = [c for c in found if c.stated]
    if len(found) > 1:
        names = " and ".join(repr(c.column.name) for c in found)
        same = _same_clock(stated) if len(stated) == len(found) else False
        if same:
            notes.append(f"{names} tell the same time: the one with more digits is taken")
            found = stated = [max(stated, key=lambda c: len(np.unique(c.column.values)))]
        else:
            opened.append(f"{names} may each be the time")
    if not found:
        first = [c for c in log.columns if not counts_rows(c) and guess_time(c.values, "") is not None]
        if not first:
            opened.append("no column is a time by its name, unit or values: give time: {rate: HZ}")
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
        return choice, guess
    if guess is None:
        return Choice(
            Entry(chosen.column.name, "s"), MISSING, ["its values do not go up: give the unit"]
        ), None
    return Choice(Entry(chosen.column.name, guess.unit), guess.sure, [guess.why]), guess


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
    time: TimeGuess | None,
    opened: list[str],
) -> dict[str, Choice]:
    own = _of_one_group([c for c in states if c.joint == joint], joint, opened)
    found: dict[str, Choice] = {}
    chosen: dict[str, Candidate] = {}
    for role in ("position", "velocity"):
        _parts(log, role, [c for c in own if c.role == role], found, chosen, opened)
    _input(log, joint, candidates, len({c.joint for c in states}) == 1, found, chosen, opened)
    if not any(name.startswith("motor") for name in found):
        for role in ("position", "velocity"):
            if f"arm_{role}" in found:  # one encoder, whatever it is called, is the joint's
                found[f"motor_{role}"] = found.pop(f"arm_{role}")
                chosen[f"motor_{role}"] = chosen.pop(f"arm_{role}")
    guess_units(log, chosen, found, time)
    return found


def _of_one_group(own: list[Candidate], joint: str, opened: list[str]) -> list[Candidate]:
    """The candidates that share their rows: those of joint states, or of the group that has most."""
    groups = list(dict.fromkeys(c.column.group for c in own))
    if len(groups) < 2:
        return own
    best = max(groups, key=lambda g: ("joint_states" in g, sum(c.column.group == g for c in own)))
    others = ", ".join(g for g in groups if g != best)
    opened.append(f"{others} may be of {joint or 'the joint'} as well as {best}")
    return [c for c in own if c.column.group == best]


def _parts(
    log: Log,
    role: str,
    own: list[Candidate],
    found: dict[str, Choice],
    chosen: dict[str, Candidate],
    opened: list[str],
) -> None:
    """Motor and arm among the candidates of one role."""
    by_part = {part: [c for c in own if c.part == part] for part in ("motor", "arm", "")}
    for part in ("motor", "arm"):
        if len(by_part[part]) > 1:
            names = " and ".join(repr(c.column.name) for c in by_part[part])
            opened.append(f"{names} may each be the {role} of the {part}")
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
        found[f"{part}_{role}"], chosen[f"{part}_{role}"] = choice, pick
    if rest:
        opened.append(f"{', '.join(repr(c.column.name) for c in rest)} may be a {role}, too")


def _input(
    log: Log,
    joint: str,
    candidates: Sequence[Candidate],
    alone: bool,
    found: dict[str, Choice],
    chosen: dict[str, Candidate],
    opened: list[str],
) -> None:
    own = [c for c in candidates if c.role == "input" and (c.joint == joint or (alone and not c.joint))]
    if alone and not own:
        own = [c for c in candidates if c.role == "input"]
    if not own:
        opened.append(f"no column is the input (torque, force, current, voltage) of {joint or 'the joint'}")
        return
    rank = {"N*m": 0, "N": 0, "A": 1, "V": 2}
    groups = {c.column.group for n, c in chosen.items()}

    def order(c: Candidate) -> tuple[int | bool, ...]:
        named = input_unit_by_name(c.column)
        pushes = bool(log.stamps) and (c.column.known or named) == "N"  # the joints of ROS mostly turn
        asked = 0 if c.measured else 2 if c.command else 1
        return still(c.column.values), c.column.group not in groups, pushes, rank.get(named, 0), asked

    pick = min(own, key=order)
    sure = STATED if pick.stated else GUESSED if pick.why else LIKELY
    choice = Choice(_entry(log, pick.column), sure, [pick.why or "input by its name"])
    if still(pick.column.values) and not pick.stated:
        choice.less(GUESSED, "it is constant: a joint is identified by an input that changes")
    if log.stamps and pick.column.group not in groups:
        choice.less(GUESSED, f"of {pick.column.group}: nothing says that it drives this joint")
    if len(own) > 1:
        names = ", ".join(repr(c.column.name) for c in own if c is not pick)
        opened.append(f"{names} may be the input as well as {pick.column.name!r}")
        choice.less(LIKELY, f"{names} may be it, too")
    found["input"], chosen["input"] = choice, pick
