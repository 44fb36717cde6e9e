"""The least-squares problem of simulated windows, made small: what is left of it fits a few hundred rows.

Errors r and their derivatives J of one window enter a Gauss-Newton search only by J'J, J'r and r'r. All three
are kept by R and Q'r of the factorisation J = Q R and the length of what Q'r leaves of r, so that a window of
thousands of samples becomes as many rows as it has columns, plus one. The search then takes no time beside
the simulation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import INITIAL, Packed, pack, predict
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.covariance import deviations, sandwich, score_covariance

Array = NDArray[np.float64]
LOGARITHMIC = ("stiffness", "motor_inertia", "arm_inertia", "torque_constant")
"""Parameters that are searched as their logarithm."""
HUGE = 1e6
"""A weighted error beyond this is just very wrong."""
WINDOW_LAGS = 8
"""Errors of a window are taken to be correlated over a window's length divided by this."""


@dataclass(frozen=True)
class Window:
    """One stretch: `angles` (n, 2) as measured, rad, NaN where missing, and `weights` (2,), 1/rad."""

    dataset: DataSet
    span: tuple[int, int]
    angles: Array
    weights: Array


def inner(name: str, value: float) -> float:
    """What the search sees of a parameter's value."""
    return (math.log(value) if value < math.inf else value) if name in LOGARITHMIC else value


def outer(name: str, value: float) -> float:
    """The value of what the search sees."""
    return math.exp(min(value, 50.0)) if name in LOGARITHMIC else float(value)


@dataclass(frozen=True)
class WindowProblem:
    """Free parameters `names` and, for each window, the initial state's components `used` (others as in
    `states` (windows, 4)). x = (parameters as the search sees them, initial states window by window)."""

    model: Model
    names: tuple[str, ...]
    windows: Sequence[Window]
    states: Array
    used: tuple[int, ...]

    def compressed(self, x: Array) -> tuple[Array, Array]:
        """Rows (m,) and their derivatives by x (m, len(x)) with the same J'J, J'r and r'r as all weighted
        errors."""
        packed, count, width = self._packed(x), len(self.names), len(self.used)
        residuals, slopes = [], []
        for number in range(len(self.windows)):
            error, jacobian = self._window(packed, number, x)
            q, r = np.linalg.qr(jacobian)
            along = q.T @ error
            rest = math.sqrt(max(float(error @ error - along @ along), 0.0))
            rows = np.zeros((len(r) + 1, len(x)))
            place = count + number * width
            rows[:-1, :count] = r[:, :count]
            rows[:-1, place : place + width] = r[:, count:]
            residuals.append(np.append(along, rest))
            slopes.append(rows)
        return np.concatenate(residuals), np.concatenate(slopes)

    def standard_errors(self, x: Array) -> Array:
        """(names,) standard errors at an optimum, errors correlated within their window (White, Econometrica
        50, 1982); NaN where the errors do not determine a parameter."""
        packed, count = self._packed(x), len(self.names)
        information, meat = np.zeros((count, count)), np.zeros((count, count))
        for number, window in enumerate(self.windows):
            error, jacobian = self._window(packed, number, x)
            own = jacobian[:, count:]
            # The part of the parameters' influence that another initial state could not have made.
            part = jacobian[:, :count]
            if own.shape[1]:
                part = part - own @ np.linalg.lstsq(own, part, rcond=None)[0]
            information += part.T @ part
            scores = (part * error[:, None]).reshape(-1, 2, count).sum(axis=1)
            lags = (window.span[1] - window.span[0]) // WINDOW_LAGS
            meat += score_covariance(scores, lags)
        scale = np.sqrt(np.maximum(np.diag(information), 0.0))
        if not np.all(scale > 0.0) or np.linalg.cond(information / np.outer(scale, scale)) > 1e12:
            return np.full(count, np.nan)
        std = deviations(sandwich(information, meat))
        factors = [outer(n, v) if n in LOGARITHMIC else 1.0 for n, v in zip(self.names, x, strict=False)]
        return std * np.array(factors)

    def _packed(self, x: Array) -> Packed:
        return pack(
            self.model.with_values({n: outer(n, v) for n, v in zip(self.names, x, strict=False)})
        )

    def _window(self, packed: Packed, number: int, x: Array) -> tuple[Array, Array]:
        """Weighted errors of a window (2 n,) and derivatives by (parameters, its initial state)."""
        window, width = self.windows[number], len(self.used)
        place = len(self.names) + number * width
        state = self.states[number].copy()
        state[list(self.used)] = x[place : place + width]
        part, dataset = slice(*window.span), window.dataset
        result = predict(
            packed,
            dataset.input[part],
            window.angles,
            dataset.dt,
            self.names + tuple(INITIAL[i] for i in self.used),
            initial_state=state,
            exogenous=None if dataset.exogenous is None else dataset.exogenous[part],
            t0=float(dataset.start + dataset.dt * window.span[0]),
        )
        error = bounded(result.innovation * window.weights).ravel()
        jacobian = bounded(result.d_innovation * window.weights[:, None]).reshape(len(error), -1)
        for column, name in enumerate(self.names):
            if name in LOGARITHMIC:
                jacobian[:, column] *= outer(name, x[column])
        return error, jacobian


def bounded(values: Array) -> Array:
    """Return the values with what is not finite, or beyond HUGE, replaced by HUGE."""
    if np.max(values, initial=-HUGE) <= HUGE and np.min(values, initial=HUGE) >= -HUGE:
        return values  # as nearly always, at a third of the time
    return np.clip(np.nan_to_num(values, nan=HUGE, posinf=HUGE, neginf=-HUGE), -HUGE, HUGE)
