"""One-step prediction and exact sensitivities of a model on recorded data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..effects import EFFECTS
from ..model import parameter_bounds
from .build import kernel
from .pack import Packed
from .simulate import acting, series_or_zeros

FloatArray = NDArray[np.float64]

#: Effects that change the torque before anything moves.
_BEFORE_THE_MOTION = frozenset(e.name for e in EFFECTS.values() if e.kind == "input")

#: Names by which the initial state may be estimated.
INITIAL = ("initial.motor_position", "initial.arm_position", "initial.motor_velocity", "initial.arm_velocity")


@dataclass(frozen=True)
class Prediction:
    """``innovation`` (n, 2): measured less predicted angle of motor and arm, rad (0 where a reading is
    missing);
    ``d_innovation`` (n, 2, parameters): its exact derivative; ``states`` (n, nx) before each correction;
    ``d_states`` (n, 4, parameters) or empty.
    """

    innovation: FloatArray
    d_innovation: FloatArray
    states: FloatArray
    d_states: FloatArray


def predict(
    packed: Packed,
    input_: ArrayLike,
    measured: ArrayLike,
    dt: float,
    free: tuple[str, ...] = (),
    *,
    gain: ArrayLike | None = None,
    decay: tuple[float, float] = (1.0, 1.0),
    gain_slopes: tuple[FloatArray, FloatArray] | None = None,
    initial_state: ArrayLike | None = None,
    external_torque: ArrayLike | None = None,
    exogenous: ArrayLike | None = None,
    moment: ArrayLike | None = None,
    t0: float = 0.0,
    keep_states: bool = False,
) -> Prediction:
    """Predict both encoders one sample ahead, with derivatives by the parameters named in ``free``.

    ``input_`` (n,): A for sfj, else N·m; ``measured`` (n, 2): motor and arm angle, rad, NaN where missing;
    ``gain`` (states, 2): observer gain, zero gives a plain simulation; ``decay``: factor per sample of the
    two disturbance torques (the last two states); ``gain_slopes``: derivatives of ``gain`` (states, 2,
    columns) and of ``decay`` (2, columns), the columns being those of ``free`` and after them as many more as
    there are quantities on which nothing else depends; by default gain and decay are held.  ``moment`` (n,):
    of the input within each sample, see `acting`.  ``free`` may also
    hold the names in ``INITIAL`` (derivatives by the initial state).  Derivatives of input effects are
    central differences, all others are exact.
    """
    measured = np.ascontiguousarray(measured, dtype=np.float64)
    torque, spread = acting(packed, input_, dt, t0, moment)
    n = len(torque)
    spreading = bool(spread.any())
    d_gain, d_decay = (np.empty((0, 2, 0)), np.empty((2, 0))) if gain_slopes is None else gain_slopes
    ncol = max(len(free), d_gain.shape[2])
    base_col = np.full(5, -1, dtype=np.int64)
    p_col = np.full(len(packed.p), -1, dtype=np.int64)
    driven: list[int] = []
    torque_slopes: list[FloatArray] = []
    moment_slopes: list[FloatArray] = []

    def through_actuator(column: int, name: str) -> None:
        by_torque, by_moment = _torque_slope(packed, input_, dt, t0, moment, name)
        driven.append(column)
        torque_slopes.append(by_torque)
        moment_slopes.append(by_moment)

    s = zero_sensitivities(packed.states, ncol)
    skew_col = np.full(2, -1, dtype=np.int64)
    for column, name in enumerate(free):
        if name in INITIAL:
            s[INITIAL.index(name), column] = 1.0
            if name == "initial.arm_velocity":
                for i in packed.velocity_states:
                    s[i, column] = 1.0
            continue
        group, position = packed.index[name]
        if group == "base":
            base_col[position] = column
        elif group == "torque_constant":
            if len(packed.in_codes):
                through_actuator(column, name)
            else:
                driven.append(column)
                torque_slopes.append(torque / packed.torque_constant)
                moment_slopes.append(spread / packed.torque_constant)
        else:
            p_col[position] = column
            if any(position == o for _, o in packed.skew):
                channel = next(c for c, o in packed.skew if o == position)
                if channel == 2:
                    through_actuator(column, name)
                else:
                    skew_col[channel] = column
            elif name.split(".")[1] in _BEFORE_THE_MOTION:
                through_actuator(column, name)
    # A reading that is late by d shows at t + d what the axis did at t: whole samples are shifted in the
    # data, which keeps every reading as it is, and the rest is left to the prediction.
    whole, lead = packed.encoder_shift(dt)
    advanced = measured
    if whole.any():
        advanced = np.full_like(measured, np.nan)
        for channel, shift in enumerate(whole):
            source = np.arange(n) + shift
            good = (source >= 0) & (source < n)
            advanced[good, channel] = measured[source[good], channel]
    outer = series_or_zeros(external_torque, n)
    if packed.rigid:
        torque = torque + outer
    other = series_or_zeros(exogenous, n)
    x = packed.initial_state()
    if initial_state is not None:
        start = np.asarray(initial_state, dtype=np.float64)
        x = packed.initial_state(*start[:4])
        x[: len(start)] = start
    k = np.zeros((packed.states, 2)) if gain is None else np.ascontiguousarray(gain, dtype=np.float64)
    innovation, states = np.empty((n, 2)), np.empty((n, packed.states))
    substeps = packed.substeps(dt)
    if not ncol:
        kernel().innovations_series(
            x,
            advanced,
            k,
            np.array(decay),
            torque,
            spread,
            outer,
            other,
            t0,
            dt,
            substeps,
            packed.rigid,
            packed.base,
            packed.codes,
            packed.p,
            packed.out_codes,
            lead,
            innovation,
            states,
        )
        return Prediction(innovation, np.empty((n, 2, 0)), states, np.empty((0, 4, 0)))
    d_innovation = np.empty((n, 2, ncol))
    d_states = np.empty((n if keep_states else 0, 4, ncol))
    kernel().predict_series(
        x,
        s,
        advanced,
        k,
        np.ascontiguousarray(d_gain),
        np.array(decay),
        np.ascontiguousarray(d_decay),
        torque,
        _columns(torque_slopes, n),
        spread,
        _columns(moment_slopes, n) if spreading else np.empty((0, 0)),
        np.array(driven, dtype=np.int64),
        outer,
        other,
        t0,
        dt,
        substeps,
        packed.rigid,
        packed.base,
        packed.codes,
        packed.p,
        base_col,
        p_col,
        packed.out_codes,
        skew_col,
        lead,
        innovation,
        d_innovation,
        states,
        d_states,
    )
    return Prediction(innovation, d_innovation, states, d_states)


def zero_sensitivities(states: int, columns: int) -> FloatArray:
    """Zeros (states, room for so many columns): the compiled loops take PITCH of them at the speed of those
    that are used, and more by a slower way that has no limit."""
    pitch = kernel().PITCH
    return np.zeros((states, -(-columns // pitch) * pitch))


def _columns(series: list[FloatArray], n: int) -> FloatArray:
    """Series (n,) side by side, sample by sample in memory; (n, 0) for none."""
    return np.ascontiguousarray(np.column_stack(series)) if series else np.empty((n, 0))


def _torque_slope(
    packed: Packed, input_: ArrayLike, dt: float, t0: float, moment: ArrayLike | None, name: str
) -> tuple[FloatArray, FloatArray]:
    """Derivatives (n,) of the acting torque and its moment by one parameter of the actuator, by central
    differences."""
    from .pack import pack

    value = packed.model.parameter_values()[name]
    low, high = parameter_bounds(packed.model, name)
    step = 1e-5 * max(abs(value), 1e-3)
    above, below = min(value + step, high), max(value - step, low)
    up = acting(pack(packed.model.with_values({name: above})), input_, dt, t0, moment)
    down = acting(pack(packed.model.with_values({name: below})), input_, dt, t0, moment)
    return (up[0] - down[0]) / (above - below), (up[1] - down[1]) / (above - below)
