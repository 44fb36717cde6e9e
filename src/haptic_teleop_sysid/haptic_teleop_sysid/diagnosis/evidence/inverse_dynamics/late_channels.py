"""Starts for a channel that is late or early: the time shift of it by which the equations hold best.

The likelihood of a delay has a hill at every period of the motion, and a fit from a small one climbs the
first. Band-limited inverse dynamics are linear in all else that is unknown,

    K u = J a + b v + F sign v + k (q_m - q_a) + c,
    k (q_m - q_a) = J_a a_a + b_a v_a + F_a sign v_a + c_a

(a rigid joint has the first, with a spring and gravity), so that each shift of a channel costs a regression.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.effects import EFFECTS, locations
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.likelihood import FAILURES
from haptic_teleop_sysid.estimation.parallel import side_by_side
from haptic_teleop_sysid.estimation.records import Record

from ...hypotheses.candidates import Scanned
from .band import motion_band
from .motion import KEPT_PER_PERIOD, BandedMotion, banded

FloatArray = NDArray[np.float64]

#: Samples of the smallest shift that is tried, to which fits come by themselves; s, of the largest; and the
#: ratio of neighbouring ones.
FIRST, MOST, RATIO = 4.0, 0.25, 1.2
#: Log-likelihood (of equations whose errors are white in the band) from which a shift is worth a start.
WORTH_A_START = 10.0
#: Rows below which a stretch says nothing: a few times as many as an equation has columns.
_FEWEST_ROWS = 40
#: Speed, as a share of the largest, within which the sign of a velocity is smoothed.
_SMOOTH = 0.05


def late_channels(model: Model, records: Sequence[Record]) -> Scanned:
    """By effect that makes a channel late, and its location, the delay (s) from which it is worth fitting:
    that by which the equations hold best, if it is FIRST samples or more; empty where the arithmetic fails.
    Of ``model`` only the structure is asked."""
    try:
        cutoff = motion_band(records)
        motions = [banded(r, model.rigid, cutoff) for r in records]
        best = side_by_side(lambda place: _best(model, motions, place), _places(model))
    except FAILURES:
        return {}
    found: Scanned = {}
    for place, delay in zip(_places(model), best, strict=True):
        for name, entry in EFFECTS.items():
            if delay == 0.0 or entry.kind != "skew" or place not in locations(name, model.structure):
                continue
            (parameter,) = entry.parameters
            if parameter.within(delay) == delay:
                found[name, model.location(place)] = [delay]
    return found


def _places(model: Model) -> tuple[str, ...]:
    # Of a rigid joint input and angle are late against each other: one number.
    return ("actuator",) if model.rigid else ("motor_encoder", "arm_encoder", "actuator")


def _best(model: Model, motions: Sequence[BandedMotion], place: str) -> float:
    """The delay, s, of the channel at a place by which the equations hold best, 0 where hardly better."""
    delay, delays = FIRST * max(m.record.dt for m in motions), [0.0]
    # What does not fit into the margins of `_nats` would read the ends again and again.
    most = min(MOST, *(len(m.time) * m.dt / 8.0 for m in motions))
    while delay < most:
        delays += [delay, -delay]
        delay *= RATIO
    nats = [sum(_nats(model, m, place, d) for m in motions) for d in delays]
    best = int(np.argmax(nats))
    return delays[best] if nats[best] > nats[0] + WORTH_A_START else 0.0


def _nats(model: Model, motion: BandedMotion, place: str, delay: float) -> float:
    """Log-likelihood of the equations of a motion whose channel at ``place`` is late by ``delay``, s; 0 for a
    stretch that says nothing, whatever the delay."""
    n, spare = len(motion.time), round((MOST + 1.0 / motion.cutoff) / motion.dt)
    # Nothing is faster than the band: more samples of it say the same again.
    step = max(round(1.0 / (KEPT_PER_PERIOD * motion.cutoff * motion.dt)), 1)
    inside = slice(spare, n - spare, step) if n > 4 * spare else slice(n // 4, n - n // 4, step)

    def shown(values: FloatArray, at: str) -> FloatArray:
        if at != place or delay == 0.0:
            return values[inside]
        return np.interp(motion.time[inside] + delay, motion.time, values)

    def moved(channel: int, at: str) -> list[FloatArray]:
        q, v, a = (shown(x[:, channel], at) for x in (motion.angle, motion.velocity, motion.acceleration))
        smooth = _SMOOTH * max(float(np.max(np.abs(v), initial=0.0)), 1e-300)
        return [q, v, a, np.tanh(v / smooth), np.ones(len(v))]

    drive = shown(motion.input, "actuator")
    if len(drive) < _FEWEST_ROWS:
        return 0.0
    angle, *motor = moved(0, "motor_encoder")
    if model.rigid:
        parts = [(drive, [*motor, angle, np.sin(angle), np.cos(angle)])]
    else:
        other, *arm = moved(1, "arm_encoder")
        deflection = angle - other
        parts = [(drive, [*motor, deflection]), (deflection, arm)]
    independent = 2.0 * motion.cutoff * motion.dt * step * len(drive)
    return sum(-0.5 * independent * np.log(_left(*part)) for part in parts)


def _left(wanted: FloatArray, columns: Sequence[FloatArray]) -> float:
    """Share of the variance of ``wanted`` (n,) that a regression on the columns leaves."""
    matrix = np.column_stack(columns)
    scaled = matrix / np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), 1e-300)
    error = wanted - scaled @ np.linalg.lstsq(scaled, wanted, rcond=1e-9)[0]
    return max(float(np.mean(error**2)) / max(float(np.var(wanted)), 1e-300), 1e-12)
