"""The thesis' progressive scheme (3.2.3): the linear model where friction matters least, then the whole one
on a growing stretch, each fit starting from the last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.fit import choose_windows
from haptic_teleop_sysid.simulation.parameter_fit import fit_output_error
from haptic_teleop_sysid.simulation.windows import cut

from .progress import Progress, silent
from .result import Estimate
from .step_limits import Limits

#: Part of the recording that each stage takes.
STRETCHES = (0.25, 0.5, 0.75, 1.0)


def progressive(
    model: Model,
    datasets: Sequence[DataSet],
    at_rest: bool = False,
    limits: Limits | None = None,
    progress: Progress = silent,
) -> Estimate:
    """Estimate by the scheme, with least squares on the simulated response throughout."""
    linear = without_nonlinear(model)
    iterations, model_now = 0, model
    lively = [liveliest(d, STRETCHES[0]) for d in datasets]
    if linear.free_parameters():
        progress("linear model", 0.1)
        own = {n: b for n, b in (limits or {}).items() if n in linear.parameter_values()}
        found = fit_output_error(linear, [(d, cut(d, None, "")) for d in lively], own, at_rest)
        iterations += found.evaluations
        values = found.model.parameter_values()
        model_now = model.with_values({n: values[n] for n in linear.free_parameters() if n in values})
    converged, message = True, ""
    for number, share in enumerate(STRETCHES, start=1):
        progress(f"{100 * share:.0f} % of the recording", 0.1 + 0.9 * (number - 1) / len(STRETCHES))
        parts = [d.between(d.start, d.start + share * (len(d) - 1) * d.dt) for d in datasets]
        found = fit_output_error(
            model_now, [(d, choose_windows(model_now, d)) for d in parts], limits, at_rest
        )
        iterations += found.evaluations
        model_now, converged = found.model, found.converged and not found.fled
        message = "converged" if converged else f"not converged on {100 * share:.0f} % of the recording"
    return Estimate(model_now, model, "progressive", converged, message, 0.0, iterations)


def without_nonlinear(model: Model) -> Model:
    """The linear part of a model: its structure, and of its effects only damping and springs."""
    kept = tuple(e for e in model.effects if e.effect in ("joint_damping", "spring_to_ground"))
    names = set(replace(model, effects=kept, fixed=()).parameter_values())
    return replace(model, effects=kept, fixed=tuple(f for f in model.fixed if f in names))


def liveliest(dataset: DataSet, share: float) -> DataSet:
    """The consecutive part of that share of the recording in which the motor moves fastest (rms)."""
    n = max(int(share * len(dataset)), 20)
    energy: NDArray[np.float64] = np.concatenate([[0.0], np.cumsum(dataset.motor_velocity**2)])
    first = int(np.argmax(energy[n:] - energy[:-n]))
    return dataset.between(dataset.start + first * dataset.dt, dataset.start + (first + n - 1) * dataset.dt)
