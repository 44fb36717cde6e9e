"""Columns of a log as signals in SI units."""

from __future__ import annotations

from collections.abc import Mapping as MappingType
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_control.errors import ConfigurationError, MismatchError, RecordingError
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.mapping import QUANTITIES, Entry
from haptic_teleop_sysid.logs.units import SI, Unit, unit_of

Array = NDArray[np.float64]
_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Signal:
    """One signal: ``values`` (n,) in ``unit`` (SI), ``quantity``, its ``column``, ``factor`` from the file's
    numbers, and ``told``: what was done to it, in words."""

    name: str
    column: Column
    values: Array
    quantity: str
    factor: float
    declared: str
    told: str

    @property
    def unit(self) -> str:
        """The SI unit of the values."""
        return SI[self.quantity]


def signals_of(log: Log, joint: str, entries: MappingType[str, Entry], source: str) -> dict[str, Signal]:
    """Return the joint's signals in SI units.

    Raises ConfigurationError for a column without a unit, of a unit that its place cannot have, or named
    twice; MismatchError where the mapping contradicts the file; RecordingError for cells that are text.
    """
    found = {name: _signal(log, f"{joint}.{name}", entry, source) for name, entry in entries.items()}
    kinds = {n: s.quantity in ("length", "velocity") for n, s in found.items() if n != "input"}
    if len(set(kinds.values())) > 1:
        told = ", ".join(f"{n} in {found[n].declared}" for n in kinds)
        raise ConfigurationError(
            f"{source}: {joint} is turning and linear at once ({told}): give a gain with gain_unit rad/m or "
            "m/rad to one of them."
        )
    drive = found.get("input")
    if drive is not None:
        linear = any(kinds.values())
        if (drive.quantity == "force" and not linear) or (drive.quantity == "torque" and linear):
            raise ConfigurationError(
                f"{source}: {joint} {'moves' if linear else 'turns'} in "
                f"{'m' if linear else 'rad'} and its input is in {drive.declared}: give it a gain with "
                f"gain_unit {'N/(N*m)' if linear else 'm'}."
            )
    _refuse_shared(joint, found, source)
    return found


def _refuse_shared(joint: str, signals: MappingType[str, Signal], source: str) -> None:
    seen: dict[int, str] = {}
    for name, signal in signals.items():
        other = seen.setdefault(id(signal.column), name)
        if other != name:
            raise ConfigurationError(
                f"{source}: column {signal.column.name!r} is both {other} and {name} of {joint}: name "
                "another column for one of them, or leave it out."
            )


def unit_in_force(log: Log, column: Column, entry: Entry, where: str, source: str) -> Unit:
    """The unit of the numbers in a column: what the mapping says, which may not contradict the file unless
    it names the column by its number."""
    stated, given, usual = unit_of(column.stated), unit_of(entry.unit), unit_of(column.usual)
    if given is None and stated is None and usual is None:
        raise ConfigurationError(
            f"{source}: {where}: nothing says in which unit column {column.name!r} of {log.path} is: give "
            "unit (deg, counts, rpm, mA, N*mm, ...)."
        )
    if given is None or stated is None or isinstance(entry.column, int):
        return given or stated or usual  # pyright: ignore[reportReturnType]
    if given.powers != stated.powers or abs(given.factor / stated.factor - 1.0) > 1e-9:
        raise MismatchError(
            f"{source}: {where} says {given.text}, but {log.path} says {stated.text} in the header "
            f"{column.name!r}: correct one of them, or name the column by its number "
            f"({log.number(column)}), which leaves its header out of account."
        )
    return given


def _signal(log: Log, name: str, entry: Entry, source: str) -> Signal:
    where = f"joints.{name.replace('_', '.')}"
    column = log.find(entry.column)
    _refuse_text(log, column)
    if not np.any(np.isfinite(column.values)):
        raise RecordingError(f"{log.path}: column {column.name!r} holds no number: name another for {where}.")
    unit = unit_in_force(log, column, entry, where, source)
    convention = " by REP 103" if column.usual and not entry.unit and not column.stated else ""
    told = f"{name}: column {column.name!r} in {unit.text}{convention}"
    factor = entry.sign * entry.gain
    if dict(unit.powers).get("count"):
        if entry.counts_per_turn is None and not entry.gain_unit:
            raise ConfigurationError(
                f"{source}: {where} is in counts: give counts_per_turn (of the joint, after quadrature and "
                "gear), or gain and gain_unit (m/count)."
            )
        if entry.counts_per_turn is not None:
            per_count = Unit("rad/count", _TURN / entry.counts_per_turn, (("count", -1), ("rad", 1)))
            unit = unit * per_count
            told += f" of {entry.counts_per_turn:g} per turn"
    elif entry.counts_per_turn is not None:
        raise ConfigurationError(
            f"{source}: {where} has counts_per_turn, but its unit is {unit.text}: give unit: counts."
        )
    if entry.gain_unit:
        unit = unit * (unit_of(entry.gain_unit) or unit)
    if entry.gain != 1.0 or entry.gain_unit:
        told += f" times {entry.gain:g} {entry.gain_unit}".rstrip()
    kind = name.rpartition("_")[2] if not name.endswith(".input") else "input"
    allowed = QUANTITIES[kind]
    if unit.quantity not in allowed:
        was = f"is of {unit.quantity}" if unit.quantity else f"has no meaning in {unit.text}"
        example = {"input": "N*m/V", "position": "rad/V", "velocity": "rad/s/V"}[kind]
        raise ConfigurationError(
            f"{source}: {where} {was}, not of {' or '.join(allowed)}: name another column, or give gain and "
            f"gain_unit (like {example})."
        )
    factor *= unit.factor
    if entry.sign < 0:
        told += ", sign reversed"
    if abs(factor - 1.0) > 1e-12:
        told += f"; each number times {factor:.10g} is {SI[unit.quantity]}"
    values = factor * column.values
    if entry.unwrap:
        if unit.quantity != "angle":
            raise ConfigurationError(f"{source}: {where} has unwrap, and is no angle: leave it out.")
        values, count = unwrapped(values)
        told += f", unwrapped at {counted(count, 'jump')} by a turn"
    return Signal(name, column, values, unit.quantity, factor, unit.text, told)


def unwrapped(angle: Array) -> tuple[Array, int]:
    """An angle (n,) in rad without its jumps by a whole turn, and how many there were."""
    good = np.isfinite(angle)
    found = angle.copy()
    found[good] = np.unwrap(angle[good])
    return found, wraps(angle)


def wraps(angle: Array) -> int:
    """How often an angle (n,) in rad jumps by a whole turn, to a tenth of one, from a row to the next; 0
    where it usually turns so far from row to row that no jump can be told."""
    steps = np.abs(np.diff(angle[np.isfinite(angle)]))
    jumps = np.abs(steps - _TURN) < 0.1 * _TURN
    usual = steps[~jumps]
    return int(np.sum(jumps)) if len(usual) and float(np.quantile(usual, 0.95)) < 0.2 * _TURN else 0


def _refuse_text(log: Log, column: Column) -> None:
    if column.text is not None:
        raise RecordingError(f"{log.path}: column {column.holds_text}, or name another column.")
