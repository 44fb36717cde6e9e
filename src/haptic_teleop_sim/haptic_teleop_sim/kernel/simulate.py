"""Simulating a model on a recorded or invented input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ..model import Model
from .build import kernel
from .pack import Packed, pack

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """What a simulation gave; all (n,) at the sample times, before the torque of that sample acts.

    ``states`` (n, nx) holds the true angles and velocities and the effects' own states; ``motor_position``
    etc. are what the encoders report, sensor effects included.
    """

    time: FloatArray
    states: FloatArray
    torque: FloatArray
    motor_position: FloatArray
    motor_velocity: FloatArray
    arm_position: FloatArray
    arm_velocity: FloatArray


def series_or_zeros(values: ArrayLike | None, n: int) -> FloatArray:
    """The values (n,) as compiled code takes them; zeros for None."""
    return np.zeros(n) if values is None else np.ascontiguousarray(values, dtype=np.float64)


def acting_torque(packed: Packed, input_: ArrayLike, dt: float, t0: float = 0.0) -> FloatArray:
    """Torque (n,) that acts on the motor over each sample in the mean, N·m: torque constant, skew and input
    effects applied.
    """
    return acting(packed, input_, dt, t0)[0]


def acting(
    packed: Packed, input_: ArrayLike, dt: float, t0: float = 0.0, moment_of_input: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Mean (n,) of the torque that acts over each sample, N·m, and its moment (n,), N·m·s²: what it does
    beside its mean because it changed within the sample, see ``effects/actuator.py``. ``moment_of_input``
    (n,): that of the input, in its unit times s², where it is the mean of one that changes faster."""
    torque = np.array(input_, dtype=np.float64) * packed.torque_constant
    moment = np.zeros(len(torque))
    if moment_of_input is not None:
        moment += packed.torque_constant * np.asarray(moment_of_input, dtype=np.float64)
    for channel, offset in packed.skew:
        if channel == 2:
            # Stamped late by d: what the record shows at t + d acted at t.
            steps = np.arange(len(torque)) + packed.p[offset] / dt
            ends = np.append(torque, torque[-1:])
            at = np.clip(np.floor(steps).astype(np.int64), 0, len(torque) - 1)
            part = np.clip(steps - at, 0.0, 1.0)
            # Until the change that lies within the sample the older value acts, for 1 - part of it.
            own = 0.5 * dt * dt * (ends[at] - ends[at + 1]) * part * (1.0 - part)
            torque, moment = (np.interp(steps, np.arange(len(v)), v) for v in (torque, moment))
            moment += own
    if len(packed.in_codes):
        kernel().actuate_series(torque, moment, t0, dt, packed.in_codes, packed.p, np.zeros(packed.memory))
    return torque, moment


class Readings(NamedTuple):
    """What the encoders report, (n,) each, rad and rad/s."""

    motor_position: FloatArray
    motor_velocity: FloatArray
    arm_position: FloatArray
    arm_velocity: FloatArray


def readings(packed: Packed, time: FloatArray, states: FloatArray) -> Readings:
    """What the encoders report of these states (n, nx), sensor effects included."""
    result: list[FloatArray] = []
    for channel in (0, 1):
        q, v = states[:, channel], states[:, 2 + channel]
        delay = sum(float(packed.p[offset]) for c, offset in packed.skew if c == channel)
        if delay != 0.0 and len(time) > 1:
            q, v = _at(time, q, v, time - delay)
        if np.any(packed.out_codes[:, 1] == channel):
            read, rate = np.empty_like(q), np.empty_like(q)
            kernel().encoder_series(
                np.ascontiguousarray(q),
                np.ascontiguousarray(v),
                channel,
                packed.out_codes,
                packed.p,
                read,
                rate,
            )
            q, v = read, rate
        result += [q, v]
    return Readings(*result)


def _at(
    time: FloatArray, q: FloatArray, v: FloatArray, when: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Angle and rate (n,) at other times; before the first sample and after the last the motion is steady.
    NaN where the motion does not stay finite."""
    if not np.all(np.isfinite(q)) or not np.all(np.isfinite(v)):
        return np.full_like(q, np.nan), np.full_like(v, np.nan)
    inside = np.clip(when, time[0], time[-1])
    spline = scipy.interpolate.CubicHermiteSpline(time, q, v)
    rate = spline(inside, 1)
    return spline(inside) + rate * (when - inside), rate


def simulate(
    model: Model | Packed,
    input_: ArrayLike,
    dt: float,
    initial_state: ArrayLike | None = None,
    *,
    external_torque: ArrayLike | None = None,
    motor_torque: ArrayLike | None = None,
    exogenous: ArrayLike | None = None,
    t0: float = 0.0,
) -> Trajectory:
    """Response of a model to an input held over each sample.

    ``input_`` (n,): current in A for sfj models, torque otherwise; ``dt`` > 0 in s; ``initial_state``: (4,)
    motor and arm angle, motor and arm velocity, or a full state; at rest at zero by default.
    ``external_torque`` (n,): torque of the environment on the arm (on the body, when rigid), N·m;
    ``motor_torque`` (n,): one on the motor beside what the actuator makes of the input, N·m, which effects
    that follow the acting torque take as part of it;
    ``exogenous`` (n,): the other stage's arm acceleration, rad/s^2, where an effect asks for it (angle or
    velocity, where a map does: `Packed.other`).  Classical
    Runge-Kutta, steps chosen by the model.
    """
    packed = model if isinstance(model, Packed) else pack(model)
    torque, moment = acting(packed, input_, dt, t0)
    if motor_torque is not None:
        torque = torque + np.asarray(motor_torque, dtype=np.float64)
    n = len(torque)
    outer = series_or_zeros(external_torque, n)
    if packed.rigid:
        torque = torque + outer
    other = series_or_zeros(exogenous, n)
    x = packed.initial_state()
    if initial_state is not None:
        start = np.asarray(initial_state, dtype=np.float64)
        x = packed.initial_state(*start[:4])
        x[: len(start)] = start
    out = np.empty((n, packed.states))
    kernel().simulate_series(
        x,
        torque,
        moment,
        outer,
        other,
        t0,
        dt,
        packed.substeps(dt),
        packed.rigid,
        packed.base,
        packed.codes,
        packed.p,
        out,
    )
    time = t0 + dt * np.arange(n, dtype=np.float64)
    return Trajectory(time, out, torque, *readings(packed, time, out))
