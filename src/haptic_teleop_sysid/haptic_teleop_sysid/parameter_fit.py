"""Least squares of a model's free parameters on recordings: simulated response against measured angles,
nothing more.

    minimise  sum over windows, samples and encoders of ((y − ŷ(parameters, initial state of the window)) /
    std(y))²

Initial states are estimated beside the parameters. Derivatives are the simulation's own. There is no noise
model and no statement of certainty here; this is for judging whether a structure can explain a recording at
all.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.kernel import INITIAL, pack, predict
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.dataset import DataSet
from haptic_teleop_sysid.initial_state import (
    angle_scales,
    bounded,
    encoder_angles,
    estimate_initial_state,
    without_actuator,
)
from haptic_teleop_sysid.windows import Windows

Array = NDArray[np.float64]
LOGARITHMIC = ("stiffness", "motor_inertia", "arm_inertia", "torque_constant")
MOST_EVALUATIONS = 60
RUNAWAY = 100.0
"""A parameter on the logarithmic scale that moved by more than this factor explains nothing; it fled."""


@dataclass(frozen=True)
class ParameterFit:
    """`model` with the values found; `converged` is false when the search was stopped by its limit of
    evaluations; `cost` is half the weighted sum of squares at the start and at the end; `fled` names
    parameters beyond RUNAWAY."""

    model: Model
    converged: bool
    cost: tuple[float, float]
    evaluations: int
    fled: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Window:
    dataset: DataSet
    span: tuple[int, int]
    angles: Array
    weights: Array


def fit_parameters(
    model: Model,
    data: Sequence[tuple[DataSet, Windows]],
    limits: Mapping[str, tuple[float, float]] | None = None,
    at_rest: bool = False,
) -> ParameterFit:
    """Return the model with its free parameters fitted to all `data` at once, within the parameters' ranges,
    narrowed by `limits`. With `at_rest` every window starts where it was measured, without speed, and initial
    states are not estimated.

    Inertias, stiffness and torque constant are searched on a logarithmic scale. Raises ModelError when
    nothing is free.
    """
    names = model.free_parameters()
    if not names:
        raise ModelError(
            f"{model.source}: every parameter is fixed, so there is nothing to fit: shorten 'fixed'."
        )
    windows = [
        _Window(dataset, span, encoder_angles(dataset, span), 1.0 / angle_scales(dataset))
        for dataset, chosen in data
        for span in chosen.spans
    ]
    used = [] if at_rest else ([0, 2] if model.rigid else [0, 1, 2, 3])
    states = np.array([_resting(window) if at_rest else _initial(model, window) for window in windows])
    values = model.parameter_values()
    start = np.array([_inner(name, values[name]) for name in names])
    lower, upper = _bounds(model, names, limits or {})
    start = np.clip(start, lower + 1e-12, upper - 1e-12)
    last: dict[bytes, Array] = {}

    def evaluate(x: Array) -> Array:
        residual, slope = _residual(model, names, windows, states, used, x)
        last.clear()
        last[x.tobytes()] = slope
        return residual

    def jacobian(x: Array) -> Array:
        if x.tobytes() not in last:
            evaluate(x)
        return last[x.tobytes()]

    free_states = states[:, used].ravel()
    unbounded = np.full(len(free_states), np.inf)
    typical = np.array([1.0 if name in LOGARITHMIC else max(abs(values[name]), 1e-3) for name in names])
    scales = np.concatenate([typical, np.tile(_state_scales(windows)[used], len(windows))])
    found = least_squares(
        evaluate,
        np.concatenate([start, free_states]),
        jac=jacobian,  # pyright: ignore[reportArgumentType]
        bounds=(np.concatenate([lower, -unbounded]), np.concatenate([upper, unbounded])),
        x_scale=scales,
        max_nfev=MOST_EVALUATIONS,
        method="trf",
    )
    begin = 0.5 * float(np.sum(evaluate(np.concatenate([start, free_states])) ** 2))
    result = {name: _outer(name, x) for name, x in zip(names, found.x, strict=False)}
    fled = tuple(
        name
        for name, x, x0 in zip(names, found.x, start, strict=False)
        if name in LOGARITHMIC and abs(x - x0) > math.log(RUNAWAY)
    )
    cost = (begin, float(found.cost))
    return ParameterFit(model.with_values(result), bool(found.status > 0), cost, int(found.nfev), fled)


def _residual(
    model: Model, names: tuple[str, ...], windows: list[_Window], states: Array, used: list[int], x: Array
) -> tuple[Array, Array]:
    """Weighted errors of all windows, (m,), and their derivatives by x = (parameters, initial states), (m,
    len(x)).
    """
    count, per_window = len(names), len(used)
    packed = pack(
        model.with_values({name: _outer(name, value) for name, value in zip(names, x, strict=False)})
    )
    inner_slope = np.array([math.exp(v) if n in LOGARITHMIC else 1.0 for n, v in zip(names, x, strict=False)])
    free = names + tuple(INITIAL[i] for i in used)
    residuals, slopes = [], []
    for number, window in enumerate(windows):
        part = slice(*window.span)
        place = count + number * per_window
        state = states[number].copy()
        state[used] = x[place : place + per_window]
        dataset = window.dataset
        result = predict(
            packed,
            dataset.input[part],
            window.angles,
            dataset.dt,
            free,
            initial_state=state,
            exogenous=None if dataset.exogenous is None else dataset.exogenous[part],
            t0=float(dataset.start + dataset.dt * window.span[0]),
        )
        residuals.append(bounded(result.innovation * window.weights).ravel())
        own = bounded(result.d_innovation * window.weights[:, None]).reshape(-1, len(free))
        wide = np.zeros((len(own), len(x)))
        wide[:, :count] = own[:, :count] * inner_slope
        wide[:, place : place + per_window] = own[:, count:]
        slopes.append(wide)
    return np.concatenate(residuals), np.concatenate(slopes)


def _initial(model: Model, window: _Window) -> Array:
    mechanics = pack(without_actuator(model))
    torque = window.dataset.input * model.parameters["torque_constant"]
    return estimate_initial_state(mechanics, window.dataset, torque, window.span)


def _state_scales(windows: list[_Window]) -> Array:
    dataset = windows[0].dataset
    speed = max(float(np.std(dataset.motor_velocity)), 1e-9)
    return np.array([*angle_scales(dataset), speed, speed])


def _inner(name: str, value: float) -> float:
    return (math.log(value) if value < math.inf else value) if name in LOGARITHMIC else value


def _outer(name: str, value: float) -> float:
    return math.exp(min(value, 50.0)) if name in LOGARITHMIC else float(value)


def _resting(window: _Window) -> Array:
    motor, arm = window.angles[0]
    return np.array([motor, arm if np.isfinite(arm) else motor, 0.0, 0.0])


def _bounds(
    model: Model, names: tuple[str, ...], limits: Mapping[str, tuple[float, float]]
) -> tuple[Array, Array]:
    ranges = {
        f"{effect.location}.{effect.effect}.{parameter.name}": (parameter.minimum, parameter.maximum)
        for effect in model.effects
        for parameter in effect.entry.parameters
    }
    lower, upper = [], []
    for name in names:
        low, high = (-np.inf, np.inf) if name in LOGARITHMIC else ranges.get(name, (0.0, np.inf))
        if name in limits:
            own = [_inner(name, v) if v > 0.0 or name not in LOGARITHMIC else -np.inf for v in limits[name]]
            low, high = max(low, own[0]), min(high, own[1])
        lower.append(low)
        upper.append(high)
    return np.array(lower), np.array(upper)
