"""Columns whose names say nothing, or hardly anything, as velocities and positions of known ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sysid.logs.evidence import ALIKE, Relation, derivative_relation, relation, still
from haptic_teleop_sysid.logs.guess import between_units
from haptic_teleop_sysid.logs.log import Column
from haptic_teleop_sysid.logs.proposal import Doubt
from haptic_teleop_sysid.logs.roles import Candidate, says_nothing

Array = NDArray[np.float64]
#: Rows that are looked at, and columns: every pair of them is compared.
ROWS, COLUMNS = 10_000, 40
#: Correlation from which one column is the integral of another.
DERIVED = 0.98


def _letters(candidate: Candidate) -> str:
    return "".join(c for c in candidate.column.label if c.isalpha()).lower()


@dataclass(frozen=True)
class Pair:
    """A ``position`` and a ``velocity`` that is its derivative; ``units``: by a factor between units."""

    position: Column
    velocity: Column
    related: Relation
    units: bool

    @property
    def told(self) -> str:
        """How they go together."""
        return (
            f"{self.position.name!r} and its derivative {self.velocity.name!r} go together (correlation "
            f"{self.related.alike:.4f})"
        )


class Free:
    """Columns that no name settles, tried as derivatives and integrals of those that names do settle."""

    def __init__(
        self,
        columns: Sequence[Column],
        candidates: Sequence[Candidate],
        seconds: Callable[[Column], Array | None],
    ) -> None:
        by_name = {id(c.column): c for c in candidates}
        states = [c for c in candidates if c.role in ("position", "velocity") and not c.command]
        weak = {id(c.column) for c in states if c.weak}
        self._seconds = seconds
        self._columns = [
            c
            for c in columns
            if (id(c) in weak or (id(c) not in by_name and says_nothing(c))) and not still(c.values[:ROWS])
        ][:COLUMNS]
        self._pairs: dict[tuple[int, int], Pair | None] = {}
        self._used: set[int] = set()
        self.candidates = self._without_derived(list(candidates), states)
        self._used |= {id(c.column) for c in self.candidates}

    def velocity_of(self, position: Column) -> Pair | None:
        """The free column that is the derivative of a position by a factor between units, best of all."""
        return self._best(self.pair(position, c) for c in self._left(position))

    def position_of(self, velocity: Column) -> Pair | None:
        """The free column of which a velocity is the derivative by a factor between units, best of all."""
        return self._best(self.pair(c, velocity) for c in self._left(velocity))

    def use(self, column: Column) -> None:
        """A column that an entry names now."""
        self._used.add(id(column))

    def pair(self, position: Column, velocity: Column) -> Pair | None:
        """The two as a pair where the one is the derivative of the other, by whatever factor."""
        key = id(position), id(velocity)
        if key not in self._pairs:
            self._pairs[key] = self._compared(position, velocity)
        return self._pairs[key]

    def doubts(self, joint: str, taken: dict[str, Column]) -> list[Doubt]:
        """What is left to be said of columns that no entry names, beside the ``taken`` ones of a joint."""
        found: list[Doubt] = []
        for part in ("motor", "arm"):
            position, velocity = taken.get(f"{part}_position"), taken.get(f"{part}_velocity")
            if position is None:
                continue
            if velocity is None:
                near = [p for c in self._left(position) if (p := self.pair(position, c)) is not None]
                found += [
                    Doubt(
                        f"{p.velocity.name!r} goes with the derivative of {p.position.name!r} (correlation "
                        f"{p.related.alike:.4f}), by a factor of {p.related.ratio:.4g} that no two units "
                        "have: if it is its velocity, enter it with its unit or a gain",
                        column=p.velocity.name,
                    )
                    for p in near
                ]
            elif (better := self.velocity_of(position)) is not None:
                named = self._related(position, velocity)
                if named is None or abs(named.alike) < ALIKE:
                    found.append(
                        Doubt(
                            f"{better.velocity.name!r} is the derivative of {position.name!r} (correlation "
                            f"{better.related.alike:.4f}), and {velocity.name!r} is not",
                            joint,
                            f"{part}_velocity",
                        )
                    )
        return found

    def unnamed(self, motor: Column | None) -> list[Doubt]:
        """Pairs of columns that nothing names, in sentences; ``motor``: position of a joint without arm."""
        left = self._left(None)
        pairs = [p for one in left for other in left if (p := self.pair(one, other)) and p.units]
        derived = {id(p.velocity) for p in pairs}
        found = []
        for p in pairs:
            if id(p.position) in derived:
                continue
            beside = None if motor is None else relation(motor.values[:ROWS], p.position.values[:ROWS])
            arm = beside is not None and abs(beside.alike) > ALIKE
            whose = f"; they go along with {motor.name!r}: the arm's?" if arm and motor else ""
            found.append(Doubt(f"{p.told}, and no name says of what{whose}", column=p.position.name))
        return found

    def _without_derived(self, candidates: list[Candidate], states: Sequence[Candidate]) -> list[Candidate]:
        """The candidates without those that are positions by a letter alone, and go with another column as
        its velocity or position. Numbers behind such a letter (x1, x2) then number columns, and no joints."""
        pairs = [
            p
            for one in states[:COLUMNS]
            for free in self._columns
            if one.column is not free and one.role == "position"
            if (p := self.pair(one.column, free)) is not None and p.units
        ]
        derived = {id(p.velocity) for p in pairs}
        mistaken = {id(p.velocity) for p in pairs if id(p.position) not in derived}
        joints = {c.joint for c in states if c.role == "position" and id(c.column) not in mistaken}
        for one in states:
            if one.role == "velocity" and not one.weak and one.joint not in joints:
                pair = self.position_of(one.column)
                mistaken |= {id(pair.position)} if pair is not None else set()
        letters = {_letters(c) for c in candidates if c.weak and id(c.column) in mistaken}
        whole = {id(p.position) for p in pairs}
        kept = []
        for c in candidates:
            if not c.weak or c.role != "position" or _letters(c) not in letters:
                kept.append(c)
            elif id(c.column) in whole and id(c.column) not in mistaken:
                kept.append(replace(c, joint=""))
        return kept

    def _left(self, beside: Column | None) -> list[Column]:
        return [c for c in self._columns if id(c) not in self._used and c is not beside]

    def _best(self, pairs: Iterable[Pair | None]) -> Pair | None:
        return max(
            (p for p in pairs if p is not None and p.units), key=lambda p: abs(p.related.alike), default=None
        )

    def _compared(self, position: Column, velocity: Column) -> Pair | None:
        found = self._related(position, velocity)
        if found is None or abs(found.alike) < DERIVED:
            return None
        return Pair(position, velocity, found, between_units(found.ratio, position, velocity))

    def _related(self, position: Column, velocity: Column) -> Relation | None:
        time = self._seconds(position)
        if position.group != velocity.group or time is None:
            return None
        if not len(time) == len(position.values) == len(velocity.values):
            return None
        rows = slice(0, ROWS)
        return derivative_relation(time[rows], position.values[rows], velocity.values[rows])
