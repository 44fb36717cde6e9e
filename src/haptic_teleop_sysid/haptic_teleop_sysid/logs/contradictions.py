"""What refutes the units and signs that are declared for a joint's signals, and what is odd about them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.logs.evidence import (
    ALIKE,
    NEAR,
    Relation,
    brakes,
    derivative_relation,
    known_factor,
    relation,
    speed_of,
    still,
)
from haptic_teleop_sysid.logs.signals import Signal, wraps

Array = NDArray[np.float64]
#: Where a signal of the motion is believed to be something else: share of it that goes along.
_UNLIKE = 0.7
#: Rows for which a position stands still, and share of the usual velocity meanwhile, to be told.
_HELD, _MOVES = 50, 0.3
#: Steps of a position that it must have missed meanwhile.
_STEPS = 5.0
#: Turns beyond which, in rad, a joint turns far.
_FAR = 2.0


def contradictions(time: Array, signals: Mapping[str, Signal]) -> tuple[list[str], list[str]]:
    """Return (what refutes a declared unit or sign, what should be looked at), in sentences. ``time`` (n,) s
    of all the signals' rows."""
    refuted: list[str] = []
    odd = [told for s in signals.values() if (told := _still(s))]
    for part in ("motor", "arm"):
        position, velocity = signals.get(f"{part}_position"), signals.get(f"{part}_velocity")
        if position is None or velocity is None or len(position.values) != len(time):
            continue
        if len(velocity.values) != len(time):
            continue
        found = derivative_relation(time, position.values, velocity.values)
        odd += _held(time, position, velocity)
        if found is not None:
            _judge_derivative(position, velocity, found, refuted, odd)
    motor, arm = signals.get("motor_position"), signals.get("arm_position")
    if motor is not None and arm is not None and len(motor.values) == len(arm.values):
        found = relation(arm.values, motor.values)
        if found is not None and abs(found.alike) > ALIKE and (known := known_factor(found.ratio)):
            refuted.append(f"{_of(arm)} is {abs(found.ratio):.4g} times {_of(motor)}: {known[1]}?")
        elif found is not None and found.alike < -_UNLIKE:
            odd.append(f"{_of(arm)} goes against {_of(motor)}: reverse a sign, unless the gear does")
        elif found is not None and found.alike > ALIKE and not 0.5 < found.ratio < 2.0:
            odd.append(
                f"{_of(arm)} is {found.ratio:.4g} times {_of(motor)}: both should be at the joint, behind "
                "any gear (gain)"
            )
    drive = signals.get("input")
    velocity = signals.get("motor_velocity")
    if drive is not None and len(time) > 1:
        speed = speed_of(
            None if motor is None else motor.values,
            None if velocity is None else velocity.values,
            motor is not None and wraps(motor.values) > 0,
        )
        if speed is not None and len(drive.values) == len(speed) and brakes(drive.values, speed):
            odd.append(
                f"{_of(drive)} brakes the joint on the whole, which what drives a joint with friction does "
                "not: is its sign reversed?"
            )
    for name in ("motor_position", "arm_position"):
        if name in signals and signals[name].quantity == "angle" and (times := wraps(signals[name].values)):
            odd.append(
                f"{_of(signals[name])} jumps by a whole turn {counted(times, 'time')}: give it unwrap: true"
            )
        elif name in signals:
            odd += _far(signals[name])
    return refuted, odd


def _still(signal: Signal) -> str:
    if not still(signal.values):
        return ""
    value = signal.values[np.isfinite(signal.values)][:1]
    why = (
        "nothing drives the joint, or another column is its input"
        if signal.name.endswith(".input")
        else "the joint does not move, or its sensor was not read"
    )
    return f"{_of(signal)} is {float(value[0]) if len(value) else np.nan:.6g} in every row: {why}"


def _held(time: Array, position: Signal, velocity: Signal) -> list[str]:
    """A position that stays where it is while its velocity goes on, by many of the position's steps."""
    p, v = position.values, velocity.values
    if len(p) < 2 * _HELD or still(p):
        return []
    ends = np.flatnonzero(np.r_[True, np.diff(p) != 0.0, True])
    lengths = np.diff(ends)
    usual = float(np.sqrt(np.nanmean(v**2)))
    changes = np.abs(np.diff(p))
    step = float(np.min(changes[changes > 0.0], initial=np.inf))
    for k in np.argsort(lengths)[::-1][:20]:
        run = slice(int(ends[k]), int(ends[k + 1]))
        if lengths[k] < _HELD:
            break
        mean = abs(float(np.nanmean(v[run])))
        way = mean * float(time[run.stop - 1] - time[run.start])
        if mean > _MOVES * usual > 0.0 and way > _STEPS * step:
            return [
                f"{_of(position)} stands still for {lengths[k]} rows from row {run.start + 1} on, while "
                f"{_of(velocity)} moves: was its sensor read?"
            ]
    return []


def _judge_derivative(
    position: Signal, velocity: Signal, found: Relation, refuted: list[str], odd: list[str]
) -> None:
    if abs(found.alike) < _UNLIKE:
        odd.append(
            f"{_of(velocity)} is not the derivative of {_of(position)} (correlation {found.alike:.2f}): is "
            "one of them another signal?"
        )
        return
    if abs(found.alike) < ALIKE:
        return
    how = f"{_of(position)} moves {abs(found.ratio):.4g} times as far as the integral of {_of(velocity)}"
    if abs(abs(found.ratio) - 1.0) > NEAR and (known := known_factor(found.ratio)):
        refuted.append(f"{how} (correlation {found.alike:.3f}): {known[1]}?")
    elif found.ratio < 0.0:
        refuted.append(f"{_of(velocity)} is the derivative of {_of(position)} with the other sign.")
    elif not 0.8 < found.ratio < 1.25:
        odd.append(
            f"{how}: is there a gear between the two? Then multiply the velocity's gain by that; if it is "
            "another joint's, leave it out"
        )


def _far(position: Signal) -> list[str]:
    """Radians that would be many turns and are within one turn as degrees; encoder steps that are a plain
    part of 360. A velocity that is the derivative says nothing of it: it may be in the same wrong unit.
    Encoder steps that are a whole part of 2 pi and not of 360 are radians of a motor that turns far."""
    if position.quantity != "angle" or position.declared not in ("rad", "radian", "radians"):
        return []
    values = position.column.values[np.isfinite(position.column.values)]
    travel = float(np.ptp(values)) / (2.0 * np.pi)
    steps = np.abs(np.diff(values))
    steps = steps[steps > 1e-9]
    step = float(np.min(steps)) if len(steps) else 0.0
    plain = _binary_part(360.0, step) and not _binary_part(2.0 * np.pi, step)
    turns = _whole_part(2.0 * np.pi, step) and not _whole_part(360.0, step)
    if float(np.max(np.abs(values))) > 360.5 or turns or not (travel > _FAR or plain):
        return []
    also = f", and its least step of {step:.4g} is 360/{360.0 / step:.0f}" if plain else ""
    return [
        f"{_of(position)} in rad turns by {travel:.1f} turns; as degrees it would stay within one{also}: "
        "are these degrees?"
    ]


def _binary_part(whole: float, step: float) -> bool:
    """Whether an encoder of 2^8 lines or a higher power of two has this step."""
    part = whole / step if step > 0.0 else 0.0
    return part >= 200.0 and abs(part / 2.0 ** round(np.log2(part)) - 1.0) < 1e-4


def _whole_part(whole: float, step: float) -> bool:
    """Whether an encoder of 200 to 20 000 counts a turn has this step: by chance once in fifty."""
    part = whole / step if step > 0.0 else 0.0
    return 200.0 <= part <= 20_000.0 and abs(part - round(part)) < 0.01


def _of(signal: Signal) -> str:
    return f"{signal.name} ({signal.column.name!r}, declared {signal.declared})"
