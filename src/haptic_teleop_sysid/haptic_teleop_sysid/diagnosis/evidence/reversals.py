"""The torque that jumps where the motion turns.

Physics of which nobody knows the form hardly changes within a moment; dry friction changes its sign where
the motion turns, so the balance of torques jumps by twice its size. Around each reversal the balance may have
a level and a slope of its own, whatever torque that is; what is regressed on accelerations, velocities,
deflection and the sign of the velocity is what is left of all reversals together (a regression discontinuity:
Hahn, Todd and van der Klaauw, Econometrica 69(1), 2001). Everything goes through one low pass, the sign, too.

    motor:           K u = J_m a_m + b_m v_m + k d + d' c + F_m sign(v_m) + level + slope t
    motor and arm:   K u = J_m a_m + b_m v_m + J_a a_a + b_a v_a + F sign(v_a) + level + slope t

The first sees friction at the motor alone, because the spring's torque shows in the deflection d.

Noise in the accelerations draws what stands before them, and the jump with it, towards zero. Where it does,
the inertia of a rigid body is held at what is known of it, from slower motion: then it is no error in a
variable, and how far it is known is part of the jump's error.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.simulation.covariance import deviations, sandwich, scaled_inverse

from .inverse_dynamics.band import highest_cutoff
from .inverse_dynamics.motion import BRIDGED, BandedMotion, banded, in_long_runs, low_passed

FloatArray = NDArray[np.float64]

#: Cut-off: so many times the frequency of the motion, Hz at most (encoder noise in the acceleration grows
#: with its square).
ABOVE, HIGHEST = 20.0, 20.0
#: Half the length of what counts around a reversal: share of the motion's period, in periods of the cut-off
#: between these.
AROUND, SHORTEST, LONGEST = 0.1, 1.0, 4.0
#: Speed, as a share of its rms, beyond which the motion has turned.
TURNED = 0.1
#: Fewest reversals of which anything is said.
FEWEST = 3
#: Share of the known inertia that the regression must find around the reversals: a relay that switches
#: elsewhere makes it nothing. That of a rigid body is held at it instead.
HELD = 0.5
#: Periods of the cut-off at either end of a recording, and of a hole, in which the filter has not settled.
_ENDS = 4.0
#: Samples to a period of the cut-off of the errors that are correlated anyway: the regression's rows.
_ROWS = 4.0


@dataclass(frozen=True)
class Jump:
    """``size``, N·m: half of what the torque jumps by; ``std``: its standard error, whatever the errors
    within a reversal have in common; ``reversals``: how many; ``input``: rms of the input torque, N·m;
    ``common``: what an inertia that is held leaves open, N·m, on all recordings in the same direction."""

    size: float
    std: float
    reversals: int
    input: float
    common: float = 0.0


def jump(
    model: Model, records: Sequence[Record], place: str, inertias: Sequence[float] = ()
) -> Jump | None:
    """The jump at the reversals of a place, motor or arm (of both equations together there), over all
    records; ``model``: with torque constant and inertia that hold; ``inertias``: what else is known of that
    of the motor, kg·m². None with fewer than FEWEST reversals, or where the input of a joint that flexes
    varies so little around them that noise in the acceleration hides what it does."""
    rows = [part for record in records for part in _around_reversals(model, record, place)]
    if len(rows) < FEWEST:
        return None
    own = model.parameters["motor_inertia"]
    found = _regressed(rows)
    if found is None:
        return None
    values, errors = found
    size, std, common = float(values[-1]), float(errors[-1]), 0.0
    if values[0] < HELD * own:
        if not model.rigid:
            return None
        freed = [[(x[:, 1:], y - inertia * x[:, 0]) for x, y in rows] for inertia in (own, *inertias)]
        held = [_regressed(one) for one in freed]
        sizes = [float(one[0][-1]) for one in held if one is not None]
        if held[0] is None:
            return None
        size, std = float(np.median(sizes)), float(held[0][1][-1])
        common = 0.5 * (max(sizes) - min(sizes))
    constant = abs(pack(model).torque_constant)
    driven = np.sqrt(np.mean(np.concatenate([r.input for r in records]) ** 2))
    return Jump(size, std, len(rows), float(constant * driven), common)


def _regressed(rows: Sequence[tuple[FloatArray, FloatArray]]) -> tuple[FloatArray, FloatArray] | None:
    """Factors of the columns and their standard errors, whatever the errors of a reversal have in common;
    None where a column is nothing."""
    columns = np.vstack([x for x, _ in rows])
    target = np.concatenate([y for _, y in rows])
    scale = np.sqrt(np.sum(columns**2, axis=0))
    if not np.all(scale > 0.0):
        return None
    # Its diagonal is one, as `scaled_inverse` makes it.
    information = (columns / scale).T @ (columns / scale)
    values = scaled_inverse(information)[1] @ ((columns / scale).T @ target)
    scores = np.array([(x / scale).T @ (y - (x / scale) @ values) for x, y in rows])
    few = len(rows) / (len(rows) - 1.0)
    errors = math.sqrt(few) * deviations(sandwich(information, scores.T @ scores))
    return values / scale, errors / scale


def _around_reversals(model: Model, record: Record, place: str) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Columns (rows, p), the sign's last, and target (rows,) around each reversal, freed of their level and
    slope there."""
    found = _motion(record, model.rigid, place)
    if found is None:
        return
    motion, period = found
    own = 1 if place == "arm" else 0
    velocity = motion.velocity[:, own]
    sign = low_passed(np.sign(velocity), motion.dt, motion.cutoff)
    columns = np.column_stack([*_columns(motion, model.rigid, place), sign])
    target = pack(model).torque_constant * motion.input
    half = float(np.clip(AROUND * period * motion.cutoff, SHORTEST, LONGEST)) / motion.cutoff
    reach = max(round(half / motion.dt), 3)
    step = max(1, int(1.0 / (_ROWS * motion.cutoff * motion.dt)))
    end = round(_ENDS / (motion.cutoff * motion.dt)) + reach
    read = _read(record, model.rigid, motion)
    straight, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, 2 * reach + 1), 2))
    for i in np.flatnonzero(np.diff(velocity >= 0.0)).tolist():
        inside = slice(i - reach, i + reach + 1)
        if i < end or i > len(velocity) - 1 - end or not np.all(read[i - end : i + end + 1]):
            continue
        if np.count_nonzero(np.diff(velocity[inside] >= 0.0)) == 1:
            x, y = columns[inside], target[inside]
            x, y = x - straight @ (straight.T @ x), y - straight @ (straight.T @ y)
            yield x[::step], y[::step]


def _read(record: Record, rigid: bool, motion: BandedMotion) -> NDArray[np.bool_]:
    """Which of the motion's samples (n,) are read, or bridged as good as read."""
    missing = np.any(~np.isfinite(record.measured[:, : 1 if rigid else 2]), axis=1)
    return ~in_long_runs(missing, BRIDGED / (motion.cutoff * record.dt))[motion.thin]


def _motion(record: Record, rigid: bool, place: str) -> tuple[BandedMotion, float] | None:
    """The motion in the band of its reversals, and its period, s; None where it does not turn twice."""
    own = 1 if place == "arm" else 0
    most = min(HIGHEST, highest_cutoff([record]))
    motion = banded(record, rigid, most)
    period = _period(motion.velocity[:, own], motion.dt)
    if period is not None and ABOVE / period < most:
        motion = banded(record, rigid, ABOVE / period)
        period = _period(motion.velocity[:, own], motion.dt)
    return None if period is None else (motion, period)


def _period(velocity: FloatArray, dt: float) -> float | None:
    """Twice the median time from one reversal to the next; what does not reach TURNED has not turned."""
    far = np.flatnonzero(np.abs(velocity) > TURNED * np.sqrt(np.mean(velocity**2)))
    turned = [b for a, b in pairwise(far.tolist()) if velocity[a] * velocity[b] < 0.0]
    return 2.0 * float(np.median(np.diff(turned))) * dt if len(turned) > 1 else None


def _columns(motion: BandedMotion, rigid: bool, place: str) -> list[FloatArray]:
    """What the equation of a place is linear in, (n,) each."""
    motor = [motion.acceleration[:, 0], motion.velocity[:, 0]]
    if rigid:
        return motor
    if place == "motor":
        apart = [q[:, 0] - q[:, 1] for q in (motion.angle, motion.velocity)]
        return [*motor, *apart]
    return [*motor, motion.acceleration[:, 1], motion.velocity[:, 1]]
