"""How well a model's simulated response matches a recording: the fit, in percent, and the error in
units.

    fit = 100 · (1 − ‖y − ŷ‖ / ‖y − mean(y)‖)

y is the recorded output; ŷ the response to the recorded input, with the initial state estimated and nothing
corrected along the way. 100 is perfect, 0 no better than the mean of y. Over several windows, ŷ is the
windows' responses one after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed, acting_torque, pack, respond
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.velocity_series import velocity_over
from haptic_teleop_sysid.simulation.initial_state import estimate_initial_states, without_actuator
from haptic_teleop_sysid.simulation.windows import (
    ASKED,
    DEFAULT_SECONDS,
    Windows,
    closed_loop,
    cut,
    drift_share,
)

Array = NDArray[np.float64]
Spans = Sequence[tuple[int, int]]
DRIFT_LIMIT = 0.1


@dataclass(frozen=True)
class SimulatedFit:
    """`percent` and `rms` (in the signal's unit) by signal; `simulated` (n,) by signal, NaN outside the
    windows; `initial_states` (windows, 4): motor and arm angle, motor and arm velocity."""

    percent: dict[str, float]
    rms: dict[str, float]
    simulated: dict[str, Array]
    windows: Windows
    initial_states: Array


def fit_percent(measured: Array, simulated: Array) -> float:
    """Return 100·(1 − ‖y − ŷ‖/‖y − mean y‖) over (n,) arrays; −inf where ŷ is not finite, NaN for a constant
    y.
    """
    spread = float(np.linalg.norm(measured - np.mean(measured)))
    if spread == 0.0:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):  # a runaway response is very wrong, and no error
        error = float(np.linalg.norm(measured - simulated))
    return 100.0 * (1.0 - error / spread) if np.isfinite(error) else float("-inf")


def choose_windows(model: Model, dataset: DataSet, window: float | str | None = None) -> Windows:
    """Return the windows for `dataset`, judged with `model` (the baseline; use the result for all models).

    `window`: seconds, "whole", or None for the rule: the whole recording, unless it is longer than one and a
    half windows and says that it was made in closed loop, or the baseline drifts away over it; then windows
    of DEFAULT_SECONDS.
    """
    if window == "whole":
        return cut(dataset, None, ASKED)
    if window is not None:
        return cut(dataset, float(window), ASKED)
    duration = len(dataset) * dataset.dt
    if duration <= 1.5 * DEFAULT_SECONDS:
        longest = f"{1.5 * DEFAULT_SECONDS:g} s"
        return cut(dataset, None, f"since recordings up to {longest} are simulated in one piece")
    if closed_loop(dataset):
        return cut(dataset, DEFAULT_SECONDS, "because the recording was made in closed loop")
    whole = simulated_fit(model, dataset, cut(dataset, None, ""))
    measured = dataset.signals()
    start, stop = whole.windows.spans[0][0], whole.windows.spans[-1][1]
    errors = {
        name: measured[name][start:stop] - values[start:stop] for name, values in whole.simulated.items()
    }
    drifting = drift_share(errors, measured, round(DEFAULT_SECONDS / dataset.dt))
    if not drifting <= DRIFT_LIMIT:
        return cut(
            dataset,
            DEFAULT_SECONDS,
            f"because the angle that is simulated drifts by {100 * drifting:.0f} % of its spread",
        )
    return cut(dataset, None, "because no controller is declared and the angle that is simulated stays near")


def simulated_fit(model: Model, dataset: DataSet, windows: Windows | None = None) -> SimulatedFit:
    """Return the fit of `model` on `dataset` over `windows` (those of `choose_windows` by default)."""
    windows = choose_windows(model, dataset) if windows is None else windows
    torque = acting_torque(pack(model), dataset.input, dataset.dt, dataset.start)
    # The actuator's memory (delays, lags) must not begin anew in each window: it has run over the whole input
    # above.
    mechanics = pack(without_actuator(model))
    measured = dataset.signals()
    spans = windows.spans
    states = estimate_initial_states(mechanics, dataset, torque, spans)
    simulated = {
        name: values
        for name, values in _responses(mechanics, dataset, torque, spans, states).items()
        if name in measured
    }
    inside = np.concatenate([np.arange(*span) for span in spans])
    percent, rms = {}, {}
    for name, values in simulated.items():
        y, y_hat = measured[name][inside], values[inside]
        percent[name] = fit_percent(y, y_hat)
        with np.errstate(over="ignore", invalid="ignore"):
            rms[name] = float(np.sqrt(np.mean((y - y_hat) ** 2)))
    return SimulatedFit(percent, rms, simulated, windows, states)


def _responses(
    mechanics: Packed, dataset: DataSet, torque: Array, spans: Spans, states: Array
) -> dict[str, Array]:
    """By signal (n,): the responses over `spans` from `states`, NaN outside."""
    found = respond(
        mechanics, torque, dataset.dt, spans, states, exogenous=dataset.exogenous, t0=float(dataset.start)
    )
    joint = dataset.joint
    return {
        f"{joint}_motor.position": found.motor_position,
        f"{joint}_motor.velocity": as_recorded(found.motor_position, found.motor_velocity, dataset, spans),
        f"{joint}_arm.position": found.arm_position,
        f"{joint}_arm.velocity": as_recorded(found.arm_position, found.arm_velocity, dataset, spans),
    }


def as_recorded(position: Array, velocity: Array, dataset: DataSet, spans: Spans) -> Array:
    """Return the velocity (n,) that the recording's velocity filter would have made of this motion over each
    of `spans`, NaN outside; unchanged without a filter.
    """
    if dataset.velocity_filter is None:
        return velocity
    # The filter had been running before a window began.
    return velocity_over(position, dataset.dt, *dataset.velocity_filter, spans, velocity)
