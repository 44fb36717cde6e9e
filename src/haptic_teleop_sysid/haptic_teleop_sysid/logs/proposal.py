"""A proposed mapping: entries with how sure they are, and what is open, each at its place."""

from __future__ import annotations

from dataclasses import dataclass, field

from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.mapping import Entry, Mapping
from haptic_teleop_sysid.logs.roles import Candidate

FILL = "FILL IN"
"""What a mapping says where the user has to."""
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


@dataclass(frozen=True)
class Doubt:
    """A sentence on what is open, and the line of the mapping that it is about: the ``signal`` of a ``joint``
    ("time" of none), a ``column`` that no entry names; of none of them, it is about the whole."""

    text: str
    joint: str = ""
    signal: str = ""
    column: str = ""


@dataclass
class Draft:
    """The mapping of one ``joint`` ("" where no header names one) while it is made: ``found``: signal ->
    Choice, ``chosen``: the candidates of those that have a column; ``opened`` and ``lacking`` as a Proposal's
    ``doubts`` and ``lacking``."""

    joint: str
    found: dict[str, Choice] = field(default_factory=dict)
    chosen: dict[str, Candidate] = field(default_factory=dict)
    opened: list[Doubt] = field(default_factory=list)
    lacking: list[str] = field(default_factory=list)

    @property
    def named(self) -> str:
        """The joint as sentences name it."""
        return self.joint or "the joint"

    def doubt(self, text: str, signal: str = "") -> None:
        """Leave something open about a signal of the joint."""
        self.opened.append(Doubt(text, self.joint or "joint", signal))


@dataclass
class Proposal:
    """A mapping that was found: ``time`` (None where the log's own stamps count), ``joints``: name -> signal
    -> Choice; ``open``: what headers leave open, in sentences, ``doubts`` those of them that no entry tells
    of; ``unused``: columns that no entry names; ``notes``: what was settled without being open; ``lacking``:
    what the log itself does not hold, which no mapping can add, in sentences with a remedy."""

    time: Choice | None
    joints: dict[str, dict[str, Choice]]
    open: list[str]
    unused: list[str]
    doubts: list[Doubt]
    notes: list[str]
    lacking: list[str] = field(default_factory=list)

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


def entry_of(log: Log, column: Column) -> Entry:
    """Return the entry of a column: by its name, or by its number where others have its name."""
    if sum(c.name == column.name for c in log.columns) == 1:
        return Entry(column.name)
    return Entry(log.number(column), column.known)


def left_over(rival: Candidate) -> str:
    """Return what is said of an entry whose column was taken because a likelier one cannot be."""
    return f"taken because {rival.column.unusable}"
