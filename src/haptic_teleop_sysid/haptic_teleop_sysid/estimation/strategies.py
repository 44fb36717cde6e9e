"""The ways to estimate: prediction error (the default), output error, and the thesis' progressive scheme."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.simulation.fit import choose_windows
from haptic_teleop_sysid.simulation.parameter_fit import fit_output_error

from .contradictions import contradictions
from .prediction_error import cross_checked, prediction_error
from .progress import Progress, silent
from .progressive import progressive
from .records import with_trusted_input
from .result import Estimate
from .step_limits import Limits, bounds

METHODS = ("prediction-error", "output-error", "progressive")


def estimate(
    model: Model,
    datasets: Sequence[DataSet],
    method: str = "prediction-error",
    *,
    at_rest: bool = False,
    multi_start: int = 1,
    seed: int = 1,
    limits: Limits | None = None,
    cross_check: bool = False,
    starts: Sequence[Model] = (),
    progress: Progress = silent,
) -> Estimate:
    """Estimate the model's free parameters from data sets of its joint.

    ``at_rest``: the initial state is known (at rest where it was first read), otherwise it is estimated.
    ``starts``: the same model with other values to start from, ``multi_start``: number of starts beside
    them, the further ones drawn with ``seed`` (prediction error only).
    ``cross_check``: estimate with a predictor that looks further ahead, too, to compare. ``limits`` narrow
    the parameters' physical ranges.  ``progress(what, share)`` is called now and then.  Raises ModelError
    when nothing is free, or a start lies outside its limits.
    """
    begun = time.perf_counter()
    check_start(model, limits)
    datasets = [with_trusted_input(d) for d in datasets]
    if method == "prediction-error":
        found = prediction_error(model, datasets, at_rest, multi_start, seed, limits, starts, progress)
        if cross_check and found.fit is not None:
            progress("cross-check by looking further ahead", 1.0)
            found = cross_checked(found, datasets, at_rest, limits)
    elif method == "output-error":
        found = _output_error(model, datasets, at_rest, limits)
    else:
        found = progressive(model, datasets, at_rest, limits, progress)
    return replace(
        found,
        seconds=time.perf_counter() - begun,
        contradictions=contradictions(found.model, found.uncertainty),
    )


def check_start(model: Model, limits: Limits | None) -> None:
    """Raise ModelError for a model with nothing to estimate, unknown names in ``limits``, or a start
    outside."""
    free, values = model.free_parameters(), model.parameter_values()
    if not free:
        raise ModelError(
            f"{model.source}: every parameter is fixed, so there is nothing to estimate: shorten 'fixed'."
        )
    for name, (low, high) in (limits or {}).items():
        if name not in values:
            raise ModelError(
                f"{model.source}: a bound names {name!r}, which the model does not have; "
                f"it has {', '.join(values)}."
            )
        if name not in free:
            raise ModelError(
                f"{model.source}: a bound names {name}, which is fixed: leave the bound out, or free it."
            )
        if not low < high:
            raise ModelError(
                f"{model.source}: the bounds of {name} are {low:g} and {high:g}; give the lower first."
            )
    for name, low, high in zip(free, *bounds(model, free, limits), strict=True):
        if not low <= values[name] <= high:
            raise ModelError(
                f"{model.source}: {name} starts at {values[name]:g}, outside its bounds "
                f"{low:g} to {high:g}: change the start or the bounds."
            )


def _output_error(
    model: Model, datasets: Sequence[DataSet], at_rest: bool, limits: Limits | None
) -> Estimate:
    found = fit_output_error(model, [(d, choose_windows(model, d)) for d in datasets], limits, at_rest)
    message = "converged" if found.converged else f"stopped at its limit of {found.evaluations} evaluations"
    if found.fled:
        message += f"; {', '.join(found.fled)} fled: the structure cannot follow the recording"
    converged = found.converged and not found.fled
    return Estimate(
        found.model, model, "output-error", converged, message, 0.0, found.evaluations, plain_std=found.std
    )
