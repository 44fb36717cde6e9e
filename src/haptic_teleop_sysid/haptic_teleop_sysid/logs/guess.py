"""Units that no header states, from ranges, steps and the agreement between columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.logs.evidence import ALIKE, NEAR, brakes, derivative_relation, speed_of
from haptic_teleop_sysid.logs.log import Column, Log
from haptic_teleop_sysid.logs.roles import Candidate, input_unit_by_name
from haptic_teleop_sysid.logs.signals import wraps
from haptic_teleop_sysid.logs.units import unit_of

Array = NDArray[np.float64]
_SCALES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
PAIRS = (
    ("rad", "rad/s"),
    ("deg", "deg/s"),
    ("deg", "rad/s"),
    ("rad", "deg/s"),
    ("rad", "rpm"),
    ("deg", "rpm"),
    ("rev", "rpm"),
    ("rev", "rev/s"),
    ("rev", "rad/s"),
    ("mm", "mm/s"),
    ("mm", "m/s"),
    ("m", "m/s"),
)
"""Units of position and velocity that go together in logs."""
#: rad that a joint hardly exceeds, and degrees that most stay within.
_RADIANS, _DEGREES = 2.1 * np.pi, 400.0
#: Counts per turn of encoders that are made, and how near to one a measured number must be.
_ENCODERS = (*(float(2**k) for k in range(9, 25)), 2000.0, 4000.0, 8000.0, 10000.0, 20000.0, 40000.0)
_ENCODER_NEAR = 0.002
#: m that a linear axis hardly exceeds.
_METRES = 5.0


@dataclass(frozen=True)
class TimeGuess:
    """``seconds`` (n,) since the first, ``unit``, how ``sure`` it is and ``why``."""

    seconds: Array
    unit: str
    sure: str
    why: str


def guess_time(values: Array, stated: str) -> TimeGuess | None:
    """The time that a column tells; None where it does not go up all along. A unit that is not stated is
    drawn from the steps: joints are logged 5 to 20000 times a second. What
    other units would make of the same steps is told."""
    good = values[np.isfinite(values)]
    if len(good) < 10 or np.mean(np.diff(good) > 0.0) < 0.9:
        return None
    step = float(np.median(np.diff(good)))
    if stated:
        unit = unit_of(stated)
        factor = unit.factor if unit else 1.0
        return TimeGuess((values - good[0]) * factor, stated, "stated", "its unit is stated")
    whole = bool(np.all(good == np.rint(good)))
    rates = {unit: 1.0 / (step * scale) for unit, scale in _SCALES.items()}
    # Of the same steps one unit makes a slow log and another one a quick log: the slow one comes first.
    likely = [u for u, rate in rates.items() if 5.0 <= rate <= 20000.0 * (1.0 + 1e-9)]
    if whole and step == 1.0 and good[0] in (0.0, 1.0):
        why = "it counts rows or milliseconds: nothing says which"
        return TimeGuess((values - good[0]) * 1e-3, "ms", "guessed", why)
    if not likely:
        return TimeGuess((values - good[0]), "s", "guessed", f"steps of {step:.3g} fit no usual rate")
    unit = likely[0] if not (whole and "ms" in likely) else "ms"
    sure = "likely" if len(likely) == 1 else "guessed"
    told = [unit, *(u for u in likely if u != unit)]
    why = ", ".join(f"in {u} it has {rates[u]:.4g} rows a second" for u in told)
    return TimeGuess((values - good[0]) * _SCALES[unit], unit, sure, why)


def guess_units(
    log: Log, chosen: Mapping[str, Candidate], found: Mapping[str, Any], time: TimeGuess | None
) -> None:
    """Put units into the choices `found` whose columns state none, and lower or explain how sure they are."""
    linear = None
    states = [c for n, c in chosen.items() if n != "input"]
    if "input" in chosen and any(c.column.group == chosen["input"].column.group for c in states):
        drive = unit_of(chosen["input"].column.known or input_unit_by_name(chosen["input"].column))
        linear = {"force": True, "torque": False}.get(drive.quantity) if drive else None
    for part in ("motor", "arm"):
        names = [n for n in (f"{part}_position", f"{part}_velocity") if n in chosen]
        coded = [n for n in names if _in_counts(chosen[n].column.known)]
        if len(names) == 2 and (coded or not all(chosen[n].column.known for n in names)):
            _by_derivative(log, chosen, found, names, time, linear)
        for name in names:
            choice, column = found[name], chosen[name].column
            if name in coded and choice.entry.counts_per_turn is None:
                choice.entry = replace(choice.entry, unit="counts")
                choice.less("missing", "fill in counts_per_turn (of the joint, behind quadrature and gear)")
            if column.known or choice.entry.unit:
                continue
            unit, sure, why = _by_range(column.values, name, column.name.startswith("/"), linear)
            choice.entry = replace(choice.entry, unit=unit)
            choice.less(sure, why)
    for name in ("motor_position", "arm_position"):
        unit = unit_of(found[name].entry.unit or chosen[name].column.known) if name in found else None
        if unit and unit.quantity == "angle" and (times := wraps(unit.factor * chosen[name].column.values)):
            found[name].entry = replace(found[name].entry, unwrap=True)
            found[name].less("likely", f"it jumps by a whole turn {counted(times, 'time')}")
    _sign(chosen, found)
    if "input" in chosen and not chosen["input"].column.known:
        choice = found["input"]
        unit = input_unit_by_name(chosen["input"].column)
        choice.entry = replace(choice.entry, unit=unit)
        choice.less("guessed" if unit else "missing", f"{unit} by its name" if unit else "fill in its unit")


def _sign(chosen: Mapping[str, Candidate], found: Mapping[str, Any]) -> None:
    """Reverse the sign of an input that brakes the joint on the whole."""
    if "input" not in chosen or chosen["input"].stated:
        return  # what a header states is not changed: `contradictions` tells of it
    drive = chosen["input"].column
    moved, velocity = (
        chosen[n].column.values * found[n].entry.sign if n in chosen else None
        for n in ("motor_position", "motor_velocity")
    )
    position = found.get("motor_position")
    speed = speed_of(moved, velocity, position is not None and position.entry.unwrap)
    if speed is not None and len(drive.values) == len(speed) > 1 and brakes(drive.values, speed):
        found["input"].entry = replace(found["input"].entry, sign=-1)
        found["input"].less("likely", "it would brake the joint on the whole, so its sign is reversed")


def _by_derivative(
    log: Log,
    chosen: Mapping[str, Candidate],
    found: Mapping[str, Any],
    names: list[str],
    time: TimeGuess | None,
    linear: bool | None,
) -> None:
    """Units of a position and a velocity from the factor between the one and the integral of the other."""
    position, velocity = (chosen[n].column for n in names)
    group = log.stamps.get(position.group)
    seconds = (group - group[0]) * 1e-9 if group is not None else None if time is None else time.seconds
    if seconds is None or not len(seconds) == len(position.values) == len(velocity.values):
        return
    related = derivative_relation(seconds, position.values, velocity.values)
    if related is None or abs(related.alike) < ALIKE:
        why = "it is not the derivative of the position" if related else "too little motion to compare"
        found[names[1]].less("guessed", why)
        return
    fitting = [
        pair
        for pair in PAIRS
        if abs(abs(related.ratio) * _factor(pair[0]) / _factor(pair[1]) - 1.0) < NEAR
        and _may_be(position.known, pair[0])
        and _may_be(velocity.known, pair[1])
        and linear in (None, pair[0] in ("m", "mm"))
    ]
    why = f"the position moves {abs(related.ratio):.4g} times as far as the integral of the velocity"
    if not fitting:
        speed, counts = _encoder(abs(related.ratio), velocity.known)
        if _whole(position.values) and counts > 50.0:
            found[names[0]].entry = replace(
                found[names[0]].entry, unit="counts", counts_per_turn=round(counts)
            )
            found[names[0]].less(
                "guessed", f"whole numbers; {counts:.5g} counts per turn if the velocity is in {speed}"
            )
            if not velocity.known:
                found[names[1]].entry = replace(found[names[1]].entry, unit=speed)
                found[names[1]].less("guessed", why)
        else:
            found[names[1]].less("guessed", f"{why}, which fits no usual pair of units")
        return
    by_range = _by_range(position.values, names[0], False, linear)[0]
    pair = next((p for p in fitting if p[0] == by_range), fitting[0])
    for name, unit, column in zip(names, pair, (position, velocity), strict=True):
        if column.known:
            continue
        found[name].entry = replace(found[name].entry, unit=unit)
        found[name].less("likely", f"{why}, as of {pair[0]} and {pair[1]}")
    if related.ratio < 0.0:
        found[names[1]].entry = replace(found[names[1]].entry, sign=-1)
        found[names[1]].less("likely", "against the position, so its sign is reversed")


def between_units(ratio: float, position: Column, velocity: Column) -> bool:
    """Whether a position and a velocity that go together by this ratio do so by units that either may have:
    by a pair of PAIRS, or as the counts of an encoder that is made."""
    if any(
        abs(abs(ratio) * _factor(one) / _factor(other) - 1.0) < NEAR
        and _may_be(position.known, one)
        and _may_be(velocity.known, other)
        for one, other in PAIRS
    ):
        return True
    coded = _in_counts(position.known) or (not position.known and _whole(position.values))
    return coded and not velocity.known and _encoder(abs(ratio), "")[1] in _ENCODERS


def _may_be(known: str, unit: str) -> bool:
    """Whether a column of this stated unit ("" for none) may be in another one: they are the same."""
    one, other = unit_of(known), unit_of(unit)
    if not known or one is None or other is None:
        return not known
    return one.powers == other.powers and abs(one.factor / other.factor - 1.0) < 1e-9


def _whole(values: Array) -> bool:
    good = values[np.isfinite(values)]
    return bool(np.all(good == np.rint(good)))


def _encoder(ratio: float, speed: str) -> tuple[str, float]:
    """(unit of the velocity, counts per turn) by how many counts the position moves per integral of the
    velocity: where no unit is known, the one by which an encoder that is made comes out, else rad/s."""
    if speed:
        return speed, ratio * 2.0 * np.pi / _factor(speed)
    for unit in ("rad/s", "rpm", "deg/s", "rev/s"):
        counts = ratio * 2.0 * np.pi / _factor(unit)
        for lines in _ENCODERS:
            if abs(counts / lines - 1.0) < _ENCODER_NEAR:
                return unit, lines
    return "rad/s", ratio * 2.0 * np.pi


def _in_counts(unit: str) -> bool:
    found = unit_of(unit)
    return found is not None and bool(dict(found.powers).get("count"))


def _factor(unit: str) -> float:
    found = unit_of(unit)
    assert found is not None
    return found.factor


def _by_range(values: Array, name: str, ros: bool, linear: bool | None) -> tuple[str, str, str]:
    """(unit, how sure, why) of a state from its values alone."""
    good = values[np.isfinite(values)]
    if ros:
        unit = "rad" if name.endswith("position") else "rad/s"
        return unit, "likely", f"{unit} by REP 103; a linear joint has m"
    if name.endswith("velocity"):
        return "m/s" if linear else "rad/s", "guessed", "nothing says its unit"
    most, travel = float(np.max(np.abs(good))), float(np.ptp(good))
    if len(np.unique(good)) > 20 and np.all(good == np.rint(good)) and travel > 50.0:
        return "counts", "missing", "whole numbers, as of an encoder: add counts_per_turn"
    if linear:
        unit = "m" if most < _METRES else "mm"
        return unit, "guessed", f"it goes to {most:.3g} and a force drives it"
    if most <= _RADIANS:
        return "rad", "guessed", f"it stays within {most:.3g}, as radians would"
    if most <= _DEGREES:
        return "deg", "guessed", f"it goes to {most:.4g}, as degrees would"
    return "deg", "guessed", "nothing says its unit"
