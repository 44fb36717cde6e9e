"""A fine search along the one parameter that fits cannot climb: an order, a natural frequency, an angle.

A ripple of order 105 gains nothing at order 104 or 106, so starts must lie denser than a linearisation of the
full model affords.  Along the recorded motion an effect is a torque (or an error of an encoder) that is known
but for its size, and the observer's innovations answer it as a linear filter: one run of that filter per
value gives the best size and what it gains (score test; the structure's parameters are projected out).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from types import SimpleNamespace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import expm

from haptic_teleop_sim.effects import EFFECTS, EffectEntry, EffectParameter, locations
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sysid.estimation.gauss_newton import Fit, whiten
from haptic_teleop_sysid.estimation.likelihood import channels, innovations
from haptic_teleop_sysid.estimation.noise import linearised, observer_gain
from haptic_teleop_sysid.estimation.records import Record

from .scales import Scales

FloatArray = NDArray[np.float64]
#: Starts by effect and place: values of the scanned parameter, best first.
Scanned = dict[tuple[str, str], list[float]]

#: Most values of one parameter, and how many of the best are starts.
_MOST_VALUES, _BEST = 160, 3
#: Shares of the furthest angles at which a stop is tried.
_SHARES = (0.998, 0.99, 0.98, 0.96, 0.94, 0.91, 0.88, 0.84, 0.8, 0.75, 0.7)
#: Ratio of neighbouring natural frequencies; a lightly damped part answers some 4 % to either side.
_RATIO = 1.04
#: Places of an angle within the travel, and the width (share of the travel) with which they are scanned.
_PLACES, _WIDTH = 24, 0.05
_CHUNK = 48


def scan(fit: Fit, records: Sequence[Record], scales: Scales) -> Scanned:
    """The most promising values of every scanned parameter, by effect and place."""
    response = _Response(fit, records)
    found: Scanned = {}
    for name, entry in EFFECTS.items():
        parameter = next((p for p in entry.parameters if p.scan), None)
        if parameter is None:
            continue
        for place in locations(name, fit.model.structure):
            values = list(_values(parameter, scales, place))
            gains = response.gains(entry, parameter, place, values)
            found[name, fit.model.location(place)] = _peaks(values, gains)
    return found


def both(one: Scanned, other: Scanned) -> Scanned:
    """The values of both, without repetition, those of ``one`` first."""
    return {key: list(dict.fromkeys([*values, *other.get(key, [])])) for key, values in one.items()}


def _values(parameter: EffectParameter, scales: Scales, place: str) -> Iterator[float]:
    channel = 1 if place.startswith("arm") else 0
    if parameter.scan == "order":
        span = max(scales.span(channel), 1e-6)
        # A sine of which less than a quarter was seen is a slope; neighbours differ by a quarter of a cycle.
        first, step = math.pi / 2 / span, math.pi / 2 / span
        for i in range(_MOST_VALUES):
            if parameter.minimum <= first + i * step <= parameter.maximum:
                yield first + i * step
    elif parameter.scan == "frequency":
        value, last = 0.5, min(0.3 / scales.dt, parameter.maximum)
        while value < last:
            yield value
            value *= _RATIO
    elif parameter.scan == "within":
        for i in range(1, _PLACES):
            yield scales.lowest[channel] + scales.span(channel) * i / _PLACES
    else:
        for end in (scales.highest[channel], scales.lowest[channel]):
            if abs(end) > 0.1 * scales.size[parameter.scale]:
                yield from (share * end for share in _SHARES)


def _peaks(values: Sequence[float], gains: FloatArray) -> list[float]:
    """Values at local maxima of the gain, best first."""
    order = [
        i
        for i in np.argsort(-gains)
        if gains[i] > 0.0 and gains[i] >= max(gains[max(i - 1, 0)], gains[min(i + 1, len(gains) - 1)])
    ]
    return [values[i] for i in order[:_BEST]]


class _Response:
    """What the innovations of a fitted model answer to torques and encoder errors."""

    def __init__(self, fit: Fit, records: Sequence[Record]):
        self.packed = pack(fit.model)
        self.fit, self.records = fit, records
        self.runs, whitened, slopes = [], [], []
        for record in records:
            run = innovations(self.packed, fit.noise, record, fit.free)
            e, j = whiten(self.packed, record, run.innovation, run.d_innovation)
            self.runs.append(run)
            whitened.append(e)
            slopes.append(j)
        jacobian = np.concatenate(slopes)
        scale = np.sqrt(np.sum(jacobian**2, axis=0))
        self.structure = np.linalg.qr(jacobian[:, scale > 0.0] / scale[scale > 0.0])[0]
        self.left = np.concatenate(whitened)
        self.left = self.left - self.structure @ (self.structure.T @ self.left)
        self.systems = [self._system(record) for record in records]

    def _system(self, record: Record) -> tuple[FloatArray, FloatArray]:
        a, _ = linearised(self.packed, self.fit.noise.reference)
        transition = expm(a * record.dt)
        transition[4, 4], transition[5, 5] = self.fit.noise.decay(record.dt)
        gain = observer_gain(self.packed, self.fit.noise, record.dt, channels(self.packed, record))
        return transition, np.ascontiguousarray(gain[[0, 1, 2, 3, -2, -1]])

    def gains(
        self, entry: EffectEntry, parameter: EffectParameter, place: str, values: Sequence[float]
    ) -> FloatArray:
        """Nats (values,) that the effect promises at each value of its scanned parameter."""
        found = np.zeros(len(values))
        channel = 1 if place.startswith("arm") else 0
        for begin in range(0, len(values), _CHUNK):
            some = values[begin : begin + _CHUNK]
            parts = []
            for record, run, (transition, gain) in zip(self.records, self.runs, self.systems, strict=True):
                columns = [_columns(entry, parameter, v, record, run.states, channel) for v in some]
                each = len(columns[0])
                answers = _answers(
                    np.ascontiguousarray(np.concatenate(columns).T),
                    channel,
                    entry.kind == "output",
                    np.isfinite(record.measured),
                    transition,
                    gain,
                )
                parts.append(whiten(self.packed, record, run.innovation, answers)[1])
            stacked = np.concatenate(parts)
            stacked -= self.structure @ (self.structure.T @ stacked)
            scores = stacked.T @ self.left
            for i in range(len(some)):
                own = slice(i * each, (i + 1) * each)
                matrix, score = stacked[:, own].T @ stacked[:, own], scores[own]
                size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
                solved = np.linalg.lstsq(matrix / np.outer(size, size), score / size, rcond=1e-9)[0]
                found[begin + i] = 0.5 * float(solved @ (score / size))
        return found


def _columns(
    entry: EffectEntry,
    parameter: EffectParameter,
    value: float,
    record: Record,
    states: FloatArray,
    channel: int,
) -> FloatArray:
    """Torques (N·m, or encoder errors, rad) (columns, n) by unit sizes of the effect along the motion."""
    zero = {p.name: 0.0 if p.default is None else p.default for p in entry.parameters}
    zero[parameter.name] = value
    if "width" in zero:
        zero["width"] = _WIDTH * float(np.ptp(states[:, channel]))
    sizes = [p.name for p in entry.parameters if p.default is None and p.neutral == 0.0]
    if "amplitude" in sizes:
        sizes = ["amplitude"]  # a mean beside it is the same at every order
    trials = [{**zero, name: 1.0} for name in sizes]
    if "phase" in zero:
        trials += [{**zero, name: 1.0, "phase": math.pi / 2} for name in sizes]
    variables = _variables(record, states, channel)
    found = []
    for numbers in trials:
        p = SimpleNamespace(**numbers)
        if entry.rates:
            _own_states(entry, variables, p, record.dt)
        torque = np.broadcast_to(np.asarray(entry.equation(variables, p), dtype=float), len(record))
        found.append(torque - variables.position if entry.kind == "output" else torque)
    return np.array(found)


def _variables(record: Record, states: FloatArray, channel: int) -> SimpleNamespace:
    """The variables and helpers in which effects write their equations, as arrays (n,) of a recording."""
    velocity = states[:, 2 + channel]
    return SimpleNamespace(
        position=states[:, channel],
        velocity=velocity,
        deflection=states[:, 0] - states[:, 1],
        time=record.start + record.dt * np.arange(len(record)),
        exogenous=record.exogenous,
        direction=np.sign(velocity),
        state0=0.0,
        state1=0.0,
        side=lambda x: np.where(np.asarray(x) >= 0.0, 1.0, -1.0),
        positive_part=lambda x: np.maximum(x, 0.0),
        dead_band=lambda x, width: np.maximum(x - width / 2, 0.0) + np.minimum(x + width / 2, 0.0),
        sin=np.sin,
        cos=np.cos,
        exp=np.exp,
        tanh=np.tanh,
        sech=lambda x: 1.0 / np.cosh(np.clip(x, -300.0, 300.0)),
        abs=np.abs,
        sqrt=np.sqrt,
        pi=math.pi,
    )


def _own_states(entry: EffectEntry, variables: SimpleNamespace, p: SimpleNamespace, dt: float) -> None:
    """Fill in the own states (at most two) of an effect whose rates are linear in them."""
    names = [f"state{i}" for i in range(len(entry.rates))]
    for name in names:
        setattr(variables, name, 0.0)
    drive = np.array([rate(variables, p) + 0.0 * variables.time for rate in entry.rates])
    matrix = np.empty((len(names), len(names)))
    for column, name in enumerate(names):
        setattr(variables, name, 1.0)
        moved = np.array([np.asarray(rate(variables, p) + 0.0 * variables.time)[0] for rate in entry.rates])
        matrix[:, column] = moved - drive[:, 0]
        setattr(variables, name, 0.0)
    n = len(names)
    whole = np.zeros((2 * n, 2 * n))
    whole[:n, :n], whole[:n, n:] = matrix, np.eye(n)
    step = expm(whole * dt)
    # Each rate's drive as it was in the middle of the step.
    drive = np.concatenate([0.5 * (drive[:, 1:] + drive[:, :-1]), drive[:, -1:]], axis=1)
    followed = _followed(np.ascontiguousarray(step[:n, :n]), np.ascontiguousarray(step[:n, n:] @ drive))
    for i, name in enumerate(names):
        setattr(variables, name, followed[i])


@njit(cache=True, error_model="numpy")
def _followed(transition: FloatArray, pushed: FloatArray) -> FloatArray:
    """States (n, samples) of x[k+1] = transition x[k] + pushed[:, k] from rest."""
    n, samples = pushed.shape
    states = np.zeros((n, samples))
    for k in range(samples - 1):
        for i in range(n):
            total = pushed[i, k]
            for j in range(n):
                total += transition[i, j] * states[j, k]
            states[i, k + 1] = total
    return states


@njit(cache=True, error_model="numpy")
def _answers(
    columns: FloatArray,
    channel: int,
    output: bool,
    read: NDArray[np.bool_],
    transition: FloatArray,
    gain: FloatArray,
) -> FloatArray:
    """Innovations (n, 2, columns) that answer each torque (n, columns) at motor (0) or arm (1), held over a
    sample, or each error of that encoder; ``read`` (n, 2): which readings there are."""
    n, m = columns.shape
    answers = np.zeros((n, 2, m))
    x = np.zeros((6, m))
    t, g = transition, gain
    # Column by column in scalars, which compilers turn into vectors over the columns.
    torque, error = 0.0 if output else 1.0, 1.0 if output else 0.0
    b = torque * transition[:, 4 + channel]
    w0, w1 = error * (1.0 - channel), error * channel
    for k in range(n):
        r0, r1 = 1.0 if read[k, 0] else 0.0, 1.0 if read[k, 1] else 0.0
        for c in range(m):
            f = columns[k, c]
            e0, e1 = r0 * (x[0, c] + w0 * f), r1 * (x[1, c] + w1 * f)
            answers[k, 0, c], answers[k, 1, c] = e0, e1
            y0 = x[0, c] - g[0, 0] * e0 - g[0, 1] * e1
            y1 = x[1, c] - g[1, 0] * e0 - g[1, 1] * e1
            y2 = x[2, c] - g[2, 0] * e0 - g[2, 1] * e1
            y3 = x[3, c] - g[3, 0] * e0 - g[3, 1] * e1
            y4 = x[4, c] - g[4, 0] * e0 - g[4, 1] * e1
            y5 = x[5, c] - g[5, 0] * e0 - g[5, 1] * e1
            x[0, c] = (
                t[0, 0] * y0
                + t[0, 1] * y1
                + t[0, 2] * y2
                + t[0, 3] * y3
                + t[0, 4] * y4
                + t[0, 5] * y5
                + b[0] * f
            )
            x[1, c] = (
                t[1, 0] * y0
                + t[1, 1] * y1
                + t[1, 2] * y2
                + t[1, 3] * y3
                + t[1, 4] * y4
                + t[1, 5] * y5
                + b[1] * f
            )
            x[2, c] = (
                t[2, 0] * y0
                + t[2, 1] * y1
                + t[2, 2] * y2
                + t[2, 3] * y3
                + t[2, 4] * y4
                + t[2, 5] * y5
                + b[2] * f
            )
            x[3, c] = (
                t[3, 0] * y0
                + t[3, 1] * y1
                + t[3, 2] * y2
                + t[3, 3] * y3
                + t[3, 4] * y4
                + t[3, 5] * y5
                + b[3] * f
            )
            x[4, c] = t[4, 4] * y4
            x[5, c] = t[5, 5] * y5
    return answers
