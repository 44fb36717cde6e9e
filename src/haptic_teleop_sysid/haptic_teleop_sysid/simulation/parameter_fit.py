"""Least squares of a model's free parameters on recordings: simulated response against measured angles,
nothing more.

    minimise  sum over windows, samples and encoders of ((y − ŷ(parameters, initial state of the window)) /
    std(y))²

Initial states are estimated beside the parameters. Derivatives are the simulation's own. There is no noise
model: this is for judging whether a structure can explain a recording, and it is biased where the input
answers the disturbance (closed loop).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.initial_state import (
    angle_scales,
    encoder_angles,
    estimate_initial_states,
    without_actuator,
)
from haptic_teleop_sysid.simulation.window_problem import LOGARITHMIC, Window, WindowProblem, inner, outer
from haptic_teleop_sysid.simulation.windows import Windows

Array = NDArray[np.float64]
MOST_EVALUATIONS = 60
RUNAWAY = 100.0
"""A parameter on the logarithmic scale that moved by more than this factor explains nothing; it fled."""


@dataclass(frozen=True)
class ParameterFit:
    """`model` with the values found; `converged` is false when the search was stopped by its limit of
    evaluations; `cost` is half the weighted sum of squares at the start and at the end; `fled` names
    parameters beyond RUNAWAY; `std`: standard errors of the free parameters by name, NaN where the recordings
    do not determine them all, and without the bias that a closed loop adds."""

    model: Model
    converged: bool
    cost: tuple[float, float]
    evaluations: int
    fled: tuple[str, ...] = ()
    std: dict[str, float] = field(default_factory=dict)


def fit_output_error(
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
        Window(dataset, span, encoder_angles(dataset)[slice(*span)], 1.0 / angle_scales(dataset))
        for dataset, chosen in data
        for span in chosen.spans
    ]
    used = () if at_rest else ((0, 2) if model.rigid else (0, 1, 2, 3))
    if at_rest:
        states = np.array([_resting(window) for window in windows])
    else:
        states = np.concatenate([_initial(model, dataset, chosen) for dataset, chosen in data])
    problem = WindowProblem(model, names, windows, states, used)
    values = model.parameter_values()
    lower, upper = _bounds(model, names, limits or {})
    start = np.clip(np.array([inner(n, values[n]) for n in names]), lower + 1e-12, upper - 1e-12)
    last: dict[bytes, Array] = {}
    first: list[float] = []

    def evaluate(x: Array) -> Array:
        residual, slope = problem.compressed(x)
        if not first:
            first.append(0.5 * float(residual @ residual))
        last.clear()
        last[x.tobytes()] = slope
        return residual

    def jacobian(x: Array) -> Array:
        if x.tobytes() not in last:
            evaluate(x)
        return last[x.tobytes()]

    free_states = states[:, list(used)].ravel()
    unbounded = np.full(len(free_states), np.inf)
    typical = np.array([1.0 if name in LOGARITHMIC else max(abs(values[name]), 1e-3) for name in names])
    found = scipy.optimize.least_squares(
        evaluate,
        np.concatenate([start, free_states]),
        jac=jacobian,  # pyright: ignore[reportArgumentType]
        bounds=(np.concatenate([lower, -unbounded]), np.concatenate([upper, unbounded])),
        x_scale=np.concatenate([typical, np.tile(_state_scales(windows)[list(used)], len(windows))]),
        max_nfev=MOST_EVALUATIONS,
        method="trf",
    )
    result = {name: outer(name, x) for name, x in zip(names, found.x, strict=False)}
    fled = tuple(
        name
        for name, x, x0 in zip(names, found.x, start, strict=False)
        if name in LOGARITHMIC and abs(x - x0) > math.log(RUNAWAY)
    )
    std = dict(zip(names, problem.standard_errors(found.x).tolist(), strict=True))
    cost = (first[0], float(found.cost))
    return ParameterFit(model.with_values(result), bool(found.status > 0), cost, int(found.nfev), fled, std)


def _initial(model: Model, dataset: DataSet, windows: Windows) -> Array:
    mechanics = pack(without_actuator(model))
    torque = dataset.input * model.parameters["torque_constant"]
    # By what is minimised here: the angles alone.
    return estimate_initial_states(mechanics, dataset, torque, windows.spans, velocities=False)


def _state_scales(windows: Sequence[Window]) -> Array:
    dataset = windows[0].dataset
    speed = max(float(np.std(dataset.motor_velocity)), 1e-9)
    return np.array([*angle_scales(dataset), speed, speed])


def _resting(window: Window) -> Array:
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
            own = [inner(name, v) if v > 0.0 or name not in LOGARITHMIC else -np.inf for v in limits[name]]
            low, high = max(low, own[0]), min(high, own[1])
        lower.append(low)
        upper.append(high)
    return np.array(lower), np.array(upper)
