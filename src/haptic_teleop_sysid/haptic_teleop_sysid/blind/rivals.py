"""What else of the table of effects would explain a hidden effect in the same recordings.

Every effect of the table is written down as a force along the trajectory that was driven, over a grid of its
shape, and fitted to the truth with the base parameters free. What is left is the distance, in nats, at which
the recordings tell the two apart. Shapes lie on a grid, so the distance is an upper bound.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sysid.blind.detect import Column, Driven, Whitener, base_columns, beyond, whiten

Array = NDArray[np.float64]
CANNOT_TELL = 5.0
"""Nats below which two explanations are one set (how_diagnosis_decides.md, step 7)."""

CONTAINS: dict[str, frozenset[str]] = {
    "stribeck_friction": frozenset({"coulomb_friction"}),
    "asymmetric_friction": frozenset({"coulomb_friction"}),
    "presliding_friction": frozenset({"coulomb_friction"}),
    "position_dependent_friction": frozenset({"coulomb_friction"}),
    "spring_to_ground": frozenset({"constant_torque"}),
    "gravity": frozenset({"constant_torque"}),
    "encoder_eccentricity": frozenset({"encoder_scale"}),
    "torque_speed_limit": frozenset({"torque_saturation"}),
}
"""Effects that hold simpler ones as a special case: explaining them is no rivalry, the simpler name is right.
Gravity and a spring to ground, alike over small angles, have as many parameters: neither is the simpler."""


NEAR = tuple(1.1**k for k in range(-8, 9))
"""Delays and time constants, relative to the truth's, among which what else is late is sought."""
NEARLY_WHOLE = (0.95, 1.06)
"""Factors of what is late between one and the next."""


@dataclass(frozen=True)
class Rival:
    """One explanation with one shape: columns that add up; `signs`: which must be positive or negative.

    `whole`: one column that counts as it is, but for NEARLY_WHOLE. So does what is late where the truth is
    late: half the delay twice is nearly a lag, and no actuator does that.
    """

    effect: str
    part: str
    columns: tuple[Column, ...]
    signs: tuple[int, ...]
    whole: bool = False


def _late(values: Array, delay: float, time: Array) -> Array:
    return np.interp(time - delay, time, values)


def _held_late(values: Array, delay: float, period: float) -> Array:
    """Mean over each sample of a held signal that comes `delay` later."""
    whole, rest = divmod(delay / period, 1.0)
    n, k = len(values), int(whole)
    padded = np.concatenate([np.zeros(k + 1), values])
    return (1.0 - rest) * padded[1 : n + 1] + rest * padded[:n]


def _lagged(values: Array, time_constant: float, period: float) -> Array:
    from scipy.signal import lfilter

    keep = np.exp(-period / time_constant)
    end = np.asarray(lfilter([1 - keep], [1, -keep], values))
    begin = np.concatenate([[0.0], end[:-1]])
    # Mean over the sample of the exponential between its two ends.
    return values + (begin - values) * (1 - keep) * time_constant / period


@njit(cache=True)
def _play(stretch: Array, width: float) -> Array:
    """State in [-1, 1] of an element that follows within `width` and slips beyond."""
    state, out = 0.0, np.empty_like(stretch)
    for k in range(len(stretch)):
        step = stretch[k] - stretch[max(k - 1, 0)]
        state = min(max(state + step / width, -1.0), 1.0)
        out[k] = state
    return out


def rivals(
    driven: Driven,
    like: Driven,
    torque_constant: float,
    stiffness: float,
    known_gain: bool,
    delays: tuple[float, ...] = (),
) -> Iterator[Rival]:
    """Yield the table's effects along `driven`, signs as the physics allows them.

    The grids of shapes come from `like`, so that several recordings share them; those of what is late from
    `delays`, of the truth, where it is late itself.
    """
    d, period = driven, driven.time[1] - driven.time[0]
    sides = (
        ("motor", d.motor, d.motor_speed, like.motor, like.motor_speed, "motor_force", "motor_error"),
        ("arm", d.arm, d.arm_speed, like.arm, like.arm_speed, "arm_force", "arm_error"),
    )
    for part, angle, speed, like_angle, like_speed, force, error in sides:

        def push(values: Array, name: str = force) -> Column:
            return Column(**{name: values})

        def show(values: Array, name: str = error) -> Column:
            return Column(**{name: values})

        rms = float(np.sqrt(np.mean(like_speed**2))) + 1e-9
        travel = float(np.ptp(like_angle)) + 1e-9
        sign = np.tanh(speed / (0.003 * rms + 2e-4))
        yield Rival("coulomb_friction", part, (push(-sign),), (1,))
        for ratio in (0.06, 0.12, 0.25, 0.4):
            near = sign * np.exp(-((speed / (ratio * rms)) ** 2))
            yield Rival("stribeck_friction", part, (push(-sign), push(-near)), (1, 1))
        yield Rival(
            "asymmetric_friction",
            part,
            (push(-sign * (speed > 0)), push(-sign * (speed <= 0))),
            (1, 1),
        )
        for share in (0.01, 0.02, 0.04):
            yield Rival("presliding_friction", part, (push(-_play(angle, share * travel)),), (1,))
        yield Rival("quadratic_drag", part, (push(-speed * np.abs(speed)),), (1,))
        for turn in (1.0, 2.0, 4.0, 8.0):
            order = max(1.0, round(turn * 2.0 / travel))
            waves = (push(-sign), push(-sign * np.sin(order * angle)), push(-sign * np.cos(order * angle)))
            yield Rival("position_dependent_friction", part, waves, (1, 0, 0))
        for time in (4.0, 8.0, 15.0):
            yield Rival("friction_drift", part, (push(-speed * -np.expm1(-d.time / time)),), (0,))
        # Both encoders are zeroed with the load on: of what always pulls at the arm, the joint's twist is not
        # seen, and the motor holds against it.
        always = np.ones_like(angle)
        pull = push(always) if part == "motor" else Column(arm_force=always, arm_error=-always / stiffness)
        yield Rival("spring_to_ground", part, (push(-angle), pull), (1, 0))
        yield Rival("constant_torque", part, (pull,), (0,))
        if part == "arm":
            # What gravity pulls at angle zero always pulls, too.
            upright = Column(arm_force=-np.cos(angle), arm_error=always / stiffness)
            yield Rival("gravity", part, (push(-np.sin(angle)), upright), (0, 0))
        for side in (-1.0, 1.0):
            reach = np.max(side * like_angle)
            for share in (0.5, 0.7, 0.85, 0.95):
                depth = np.maximum(side * angle - share * reach, 0.0)
                yield Rival("hard_stop", part, (push(-side * depth),), (1,))
        for turn in (0.5, 1.0, 2.0, 4.0, 8.0):
            order = max(1.0, round(turn * 2.0 / travel))
            sine, cosine = np.sin(order * angle), np.cos(order * angle)
            if part == "motor":
                yield Rival("torque_ripple", part, (push(sine), push(cosine)), (0, 0))
            # Encoders are zeroed where they begin.
            waves = (sine, cosine - 1.0)
            yield Rival("encoder_eccentricity", f"{part}_encoder", tuple(show(w) for w in waves), (0, 0))
        yield Rival("encoder_scale", f"{part}_encoder", (show(angle),), (0,))
        for delay in _near(delays) or (0.002, 0.006, 0.015, 0.03):
            shift = _late(angle, delay, d.time) - angle
            early = _late(angle, -delay, d.time) - angle
            for effect, change in (("sensor_delay", shift), ("channel_skew", shift), ("channel_skew", early)):
                yield Rival(effect, f"{part}_encoder", (show(change),), (1,), bool(delays))
    yield from _joint(driven, like, stiffness)
    yield from _actuator(driven, like, torque_constant, period, known_gain, delays)


def _joint(d: Driven, like: Driven, stiffness: float) -> Iterator[Rival]:
    stretch, rate = d.motor - d.arm, d.motor_speed - d.arm_speed
    rms = float(np.sqrt(np.mean((like.motor - like.arm) ** 2))) + 1e-9

    def pair(values: Array) -> Column:
        return Column(motor_force=-values, arm_force=values)

    yield Rival(
        "load_dependent_friction",
        "motor",
        (
            Column(
                motor_force=-np.abs(stiffness * stretch)
                * np.tanh(d.motor_speed / (0.003 * np.std(like.motor_speed) + 2e-4))
            ),
        ),
        (1,),
    )
    for width in (0.05, 0.15, 0.4, 0.8):
        yield Rival("backlash", "joint", (pair(-np.clip(stretch, -width * rms, width * rms)),), (1,))
    yield Rival("hardening_spring", "joint", (pair(stretch**3),), (0,))
    for width in (0.05, 0.15, 0.3, 0.6):
        yield Rival("hysteresis", "joint", (pair(_play(stretch, width * rms)),), (1,))
    yield Rival("joint_damping", "joint", (pair(rate),), (1,))
    yield Rival("inertial_coupling", "arm", (Column(arm_force=-d.other_acceleration),), (0,))
    for share in (0.2, 0.35, 0.5, 0.65, 0.8):
        later = d.time >= share * d.time[-1]
        yield Rival("payload_change", "arm", (Column(arm_force=-d.arm_acceleration * later),), (1,))
    travel = float(np.ptp(like.arm)) + 1e-9
    for turn in (0.5, 1.0, 2.0, 4.0):
        order = max(1.0, round(turn * 2.0 / travel))
        sine, cosine = np.sin(order * d.arm), np.cos(order * d.arm)
        waves = ((cosine, -order * sine), (sine, order * cosine))
        columns = (
            Column(arm_force=-(wave * d.arm_acceleration + 0.5 * slope * d.arm_speed**2))
            for wave, slope in waves
        )
        yield Rival("angle_dependent_inertia", "arm", tuple(columns), (0, 0))
    for frequency in (0.7, 1.2, 2.0, 3.5, 6.0, 10.0):
        yield Rival("extra_flexible_mode", "arm", (Column(arm_force=_mode_force(d, frequency)),), (1,))


def _mode_force(d: Driven, frequency: float) -> Array:
    """Force on the arm of a unit mass hung on it by a spring of that frequency, damping 2 %."""
    from scipy.signal import cont2discrete, lfilter

    w = 2 * np.pi * frequency
    found: Any = cont2discrete(([-2 * 0.02 * w, -w * w], [1.0, 2 * 0.02 * w, w * w]), 0.002, "foh")
    return np.asarray(lfilter(np.ravel(found[0]), found[1], d.arm_acceleration))


def _actuator(
    d: Driven, like: Driven, kt: float, period: float, known_gain: bool, delays: tuple[float, ...]
) -> Iterator[Rival]:
    u, peak = d.current, float(np.max(np.abs(like.current))) + 1e-9

    def both(effect: str, change: Array, whole: bool = False) -> Iterator[Rival]:
        # Behind the current sense it is a force alone; before it, the sense shows it as well.
        yield Rival(effect, "actuator", (Column(motor_force=kt * change),), (1,), whole)
        yield Rival(effect, "actuator", (Column(motor_force=kt * change, current=change),), (1,), whole)

    for delay in _near(delays) or (0.002, 0.005, 0.01, 0.02, 0.04):
        yield from both("input_delay", _held_late(u, delay, period) - u, bool(delays))
        for way in (-delay, delay):
            shift = (
                _late(u, way, d.time) - u
            )  # only the sense is off: the command says what really acted, when
            yield Rival("channel_skew", "actuator", (Column(current=shift),), (1,), bool(delays))
    for time in _near(delays) or (0.002, 0.005, 0.012, 0.03, 0.07):
        yield from both("actuator_lag", _lagged(u, time, period) - u, bool(delays))
    for share in (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.98):
        yield from both("torque_saturation", np.clip(u, -share * peak, share * peak) - u)
    fastest = float(np.max(np.abs(like.motor_speed))) + 1e-9
    for level, share in itertools.product((0.8, 1.0), (0.15, 0.4, 0.8)):
        left = np.where(u * d.motor_speed > 0.0, level - share * np.abs(d.motor_speed) / fastest, level)
        left = peak * np.maximum(left, 0.0)
        change = np.clip(u, -left, left) - u
        yield Rival("torque_speed_limit", "actuator", (Column(motor_force=kt * change),), (1,))
    for share in (0.03, 0.1, 0.25):
        yield from both("dead_zone", -np.clip(u, -share * peak, share * peak))
    if known_gain:
        yield Rival("gain_error", "actuator", (Column(motor_force=kt * u),), (0,))
    for time in (4.0, 8.0, 15.0):
        yield Rival("gain_drift", "actuator", (Column(motor_force=-kt * u * np.expm1(-d.time / time)),), (0,))


def _near(delays: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(delay * factor for delay in delays for factor in NEAR)


def distances(
    filter_: Whitener,
    experiments: list[tuple[Driven, Column]],
    torque_constant: float,
    stiffness: float,
    known_torque_constant: bool,
    delays: tuple[float, ...] = (),
) -> dict[tuple[str, str], float]:
    """Return nats between the truth and the nearest shape of each (effect, part), both recordings together.

    `experiments`: each recording's trajectory and what the truth adds to it; `delays`: of the truth itself,
    or its time constant, without which the grid would call a late reading and a late stamp two things.
    """
    rows: list[Array] = []
    listed: list[Rival] = []
    for driven, truth in experiments:
        like = experiments[0][0]
        found = list(rivals(driven, like, torque_constant, stiffness, known_torque_constant, delays))
        base = base_columns(filter_, driven, known_torque_constant)
        columns = [truth, *(column for rival in found for column in rival.columns)]
        rows.append(beyond(base, whiten(filter_, columns, len(driven.motor))))
        listed = found
    joined = np.concatenate(rows)
    gram = joined.T @ joined
    nearest: dict[tuple[str, str], float] = {}
    place = 1
    for rival in listed:
        chosen = np.arange(place, place + len(rival.columns))
        place += len(rival.columns)
        left = 0.5 * (_left_by_one(gram, chosen[0]) if rival.whole else _left(gram, chosen, rival.signs))
        key = (rival.effect, rival.part)
        nearest[key] = min(nearest.get(key, np.inf), left)
    return nearest


def _left_by_one(gram: Array, chosen: np.intp) -> float:
    """Return the squared length of column 0 that one column, NEARLY_WHOLE, cannot explain."""
    square = max(float(gram[chosen, chosen]), 1e-20)
    share = float(np.clip(gram[0, chosen] / square, *NEARLY_WHOLE))
    return max(float(gram[0, 0]) - 2.0 * share * float(gram[0, chosen]) + share**2 * square, 0.0)


def _left(gram: Array, chosen: NDArray[np.intp], signs: tuple[int, ...]) -> float:
    """Return the squared length of column 0 that the chosen columns, with their signs, cannot explain."""
    active = list(chosen)
    sign = dict(zip(chosen.tolist(), signs, strict=True))
    while active:
        inner = gram[np.ix_(active, active)]
        scale = np.sqrt(np.maximum(np.diag(inner), 1e-20))
        solution = np.linalg.lstsq(inner / np.outer(scale, scale), gram[active, 0] / scale, rcond=1e-10)[0]
        wrong = [i for i, c in enumerate(active) if sign[int(c)] and np.sign(solution[i]) * sign[int(c)] < 0]
        if not wrong:
            explained = float(solution @ (gram[active, 0] / scale))
            return max(float(gram[0, 0]) - explained, 0.0)
        active.pop(wrong[0])
    return float(gram[0, 0])
