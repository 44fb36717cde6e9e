"""Do the signals of a joint agree with each other?  A velocity is the derivative of its position; a factor
between the two that is one between units says that one of them is declared wrongly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.counted import counted
from haptic_teleop_sysid.logs.signals import Signal, wraps
from haptic_teleop_sysid.recordings.median_frequency import median_periods

Array = NDArray[np.float64]
_DEGREES = 180.0 / np.pi
#: Factors that units differ by: what is so many times too large, and what it then is.
FACTORS = {
    _DEGREES: "degrees taken for radians",
    2.0 * np.pi: "radians taken for turns, or hertz for rad/s",
    60.0 / (2.0 * np.pi): "turns per minute taken for rad/s",
    360.0: "degrees taken for turns",
    6.0: "degrees per second taken for turns per minute",
    60.0: "a time per minute taken for one per second",
    1000.0: "a thousandth taken for the whole unit (mm, ms, mrad)",
    100.0: "a hundredth taken for the whole unit (cm)",
    1e6: "a millionth taken for the whole unit (us, um)",
    25.4: "millimetres taken for inches",
}
#: How near a measured factor must come, and how well two signals must go together for it to count.
NEAR, ALIKE = 0.02, 0.95
#: Where a signal of the motion is believed to be something else: share of it that goes along.
UNLIKE = 0.7
#: Power, relative to the rms of input and velocity, below which the input brakes.
BRAKES = -0.1
#: The same from which it brakes, whenever it acts. By hand: 0.2 is the most by which an input of the right
#: sign seems to brake, in both halves of one of 116 recordings; a late thrust moves that joint.
BRAKES_HARD = -0.3
#: Share of a period of the motion by which the input may act later, and how many times within it are tried.
LATER, _LATE_STEPS = 0.125, 4
#: Rows for which a position stands still, and share of the usual velocity meanwhile, to be told.
_HELD, _MOVES = 50, 0.3
#: Steps of a position that it must have missed meanwhile.
_STEPS = 5.0
#: Turns beyond which, in rad, a joint turns far.
_FAR = 2.0


@dataclass(frozen=True)
class Relation:
    """How one signal goes with another: ``ratio`` of the first to what the second makes of it, ``alike``:
    correlation between the two, -1 to 1."""

    ratio: float
    alike: float


def derivative_relation(time: Array, position: Array, velocity: Array) -> Relation | None:
    """Relation of a position (n,) to the integral of a velocity (n,), both without their trend; None where
    either hardly moves or there are too few samples. A step back in time counts for neither: nobody knows how
    long it took."""
    good = np.isfinite(position) & np.isfinite(velocity) & np.isfinite(time)
    good[1:] &= np.diff(time) != 0.0
    if np.sum(good) < 20:
        return None
    t, p, v = time[good], position[good], velocity[good]
    steps = np.diff(t)
    forward = steps > 0.0
    way = np.cumsum(np.where(forward, 0.5 * (v[1:] + v[:-1]) * steps, 0.0))
    moved = np.cumsum(np.where(forward, np.diff(p), 0.0))
    return relation(np.r_[p[0], p[0] + moved], np.r_[0.0, way])


def relation(one: Array, other: Array) -> Relation | None:
    """Relation of two signals (n,) without their trends."""
    good = np.isfinite(one) & np.isfinite(other)
    if np.sum(good) < 20:
        return None
    a, b = scipy.signal.detrend(one[good]), scipy.signal.detrend(other[good])
    spread = float(np.std(a)), float(np.std(b))
    if min(spread) <= 1e-9 * max(float(np.max(np.abs(one[good]))), 1e-300) or min(spread) <= 0.0:
        return None
    alike = float(np.mean(a * b) / (spread[0] * spread[1]))
    return Relation(spread[0] / spread[1] * np.sign(alike), alike)


def still(values: Array) -> bool:
    """Whether a signal (n,) has one value alone, or none."""
    good = values[np.isfinite(values)]
    return len(good) == 0 or bool(np.all(good == good[0]))


def known_factor(ratio: float) -> tuple[float, str] | None:
    """(factor above one, what it is between) that a ratio, or one over it, comes near to; None for none."""
    size = abs(ratio) if abs(ratio) > 1.0 else 1.0 / max(abs(ratio), 1e-300)
    for factor, what in FACTORS.items():
        if abs(size / factor - 1.0) < NEAR:
            return factor, what
    return None


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
        elif found is not None and found.alike < -UNLIKE:
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


def speed_of(position: Array | None, velocity: Array | None, jumps: bool) -> Array | None:
    """The velocity (n,), in any unit, that tells in which direction a joint moves: the position's change,
    because a recorded velocity may have been filtered and be late, unless the position ``jumps`` by whole
    turns; None where there is neither."""
    if position is not None and len(position) > 1 and not (jumps and velocity is not None):
        return np.gradient(position)
    return velocity


def brakes(drive: Array, velocity: Array) -> bool:
    """Whether an input (n,) takes energy out of a joint of this velocity (n,), clearly and in both halves.

    Where it does so by little, it must do so if it acted later, too, by up to LATER periods of the motion: a
    controller has braked a mass before a thrust does that takes time. An input of the opposite sign that a
    mass follows brakes all the same; one that mostly holds a spring is not found then."""
    good = np.isfinite(drive) & np.isfinite(velocity)
    if np.sum(good) < 40:
        return False
    u, v = drive[good], velocity[good]
    scale = float(np.sqrt(np.mean(u**2) * np.mean(v**2)))
    half, latest = len(u) // 2, int(LATER * (len(v) / max(median_periods(v), 1)))

    def weakest(late: int) -> float:
        """Power of the half in which it takes less, relative to the rms of both."""
        parts = slice(half), slice(half, 2 * half)
        return max(float(np.mean(u[s][: half - late] * v[s][late:half])) for s in parts) / scale

    if not scale > 0.0:
        return False
    lates = (latest * step // _LATE_STEPS for step in range(_LATE_STEPS + 1))
    return weakest(0) < BRAKES_HARD or all(weakest(late) < BRAKES for late in lates)


def _judge_derivative(
    position: Signal, velocity: Signal, found: Relation, refuted: list[str], odd: list[str]
) -> None:
    if abs(found.alike) < UNLIKE:
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
