"""A proposed mapping: entries with how sure they are, and what is open, each at its place."""

from __future__ import annotations

from dataclasses import dataclass, field

from haptic_teleop_sysid.logs.mapping import Entry, Mapping

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
