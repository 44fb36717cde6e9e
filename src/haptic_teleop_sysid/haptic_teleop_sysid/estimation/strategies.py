"""The ways to estimate: prediction error (the default), output error, and the thesis' progressive scheme."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.dataset import DataSet
from haptic_teleop_sysid.fit import choose_windows
from haptic_teleop_sysid.parameter_fit import fit_parameters as least_squares
from haptic_teleop_sysid.windows import cut

from .gauss_newton import Fit, Limits, bounds
from .graduated import STAGES, approach, fit_from_afar
from .records import Record, record_from, with_trusted_input
from .uncertainty import Uncertainty, uncertainty

METHODS = ("prediction-error", "output-error", "progressive")
#: Further starts lie within this factor of the given one, either side.
SPREAD = 3.0
#: Standard errors between two methods beyond which one of them must be wrong.
DISAGREEMENT = 3.0
#: Relative gain at which the cross-check by output error ends: far finer than its standard errors.
CHECK_TOLERANCE = 1e-4
CHECK_EVALUATIONS = 40
#: Part of the recording that each stage of the progressive scheme takes.
STRETCHES = (0.25, 0.5, 0.75, 1.0)

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Estimate:
    """``model`` with the values found by ``method`` from ``start``; ``converged`` with a sentence in
    ``message``; ``fit`` and ``uncertainty`` for the prediction-error method, None for the others, which
    know no noise; ``starts``: log-likelihood reached from each start (the given one first); ``seconds`` it
    took; ``output_error``: value and standard error (NaN where it has none) of the free parameters by the
    cross-check; empty where that did not arrive, None where it was not asked for."""

    model: Model
    start: Model
    method: str
    converged: bool
    message: str
    seconds: float
    iterations: int
    fit: Fit | None = None
    uncertainty: Uncertainty | None = None
    starts: tuple[float, ...] = ()
    output_error: dict[str, tuple[float, float]] | None = None

    def disagreement(self) -> dict[str, float]:
        """Parameters that the output error puts elsewhere, by more than DISAGREEMENT standard errors of the
        difference and 10 %: name -> its value. Empty without a cross-check."""
        unsure, found = self.uncertainty, self.model.parameter_values()
        if not self.output_error or unsure is None:
            return {}
        apart = {}
        for name, (other, std) in self.output_error.items():
            if name in unsure.undetermined:
                continue
            own = float(unsure.std[unsure.names.index(name)])
            difference = abs(other - found[name])
            # Not so with a standard error that is no number: nothing can then be said.
            if difference > DISAGREEMENT * np.hypot(own, std) and difference > 0.1 * abs(found[name]):
                apart[name] = other
        return apart


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
    progress: Progress | None = None,
) -> Estimate:
    """Estimate the model's free parameters from data sets of its joint.

    ``at_rest``: the initial state is known (at rest where it was first read), otherwise it is estimated.
    ``multi_start``: number of starts, the further ones drawn with ``seed`` within a factor of SPREAD
    (prediction error only).  ``cross_check``: estimate by output error too, and keep its values to compare.
    ``limits`` narrow the parameters' physical ranges.  ``progress(what, share)`` is called now and then.
    Raises ModelError when nothing is free, or a start lies outside its limits.
    """
    begun = time.perf_counter()
    check_start(model, limits)
    datasets = [with_trusted_input(d) for d in datasets]
    if method == "prediction-error":
        found = _prediction_error(model, datasets, at_rest, multi_start, seed, limits, progress)
        if cross_check and found.fit is not None:
            if progress is not None:
                progress("cross-check by output error", 1.0)
            pairs = [(d, choose_windows(found.model, d)) for d in datasets]
            other = least_squares(found.model, pairs, limits, at_rest, CHECK_EVALUATIONS, CHECK_TOLERANCE)
            values = other.model.parameter_values()
            arrived = other.converged and not other.fled
            found = replace(
                found, output_error={n: (values[n], s) for n, s in other.std.items()} if arrived else {}
            )
    elif method == "output-error":
        found = _output_error(model, datasets, at_rest, limits)
    else:
        found = _progressive(model, datasets, at_rest, limits, progress)
    return replace(found, seconds=time.perf_counter() - begun)


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


def _prediction_error(
    model: Model,
    datasets: Sequence[DataSet],
    at_rest: bool,
    multi_start: int,
    seed: int,
    limits: Limits | None,
    progress: Progress | None,
) -> Estimate:
    records = [replace(record_from(d), at_rest=at_rest) for d in datasets]
    starts = [model, *_further_starts(model, records, multi_start - 1, seed, limits)]
    steps = len(starts) + 1

    def stage(number: int, name: str) -> Callable[[int, float], None]:
        def count(iteration: int, value: float) -> None:
            if progress is not None:
                progress(f"{name}, step {iteration}", (number + 1.0 - 0.7**iteration) / steps)

        return count

    fits = []
    if multi_start > 1:
        fits = []
        for i, start in enumerate(starts):
            tell = stage(i, f"start {i + 1} of {len(starts)}")
            fits.append(
                approach(start, records, limits=limits, iterations=8, stages=STAGES[:1], progress=tell)
            )
        model_near = max(fits, key=lambda one: one.log_likelihood).model
    else:
        model_near = model
    fit = fit_from_afar(model_near, records, limits=limits, progress=stage(steps - 1, "predictor"))
    if progress is not None:
        progress("uncertainty", 1.0)
    if not np.isfinite(fit.log_likelihood):
        return Estimate(
            model,
            model,
            "prediction-error",
            False,
            "the model predicts nothing from this start: its response runs away; try other start values, "
            "or --multi-start",
            0.0,
            fit.iterations,
        )
    return Estimate(
        fit.model,
        model,
        "prediction-error",
        fit.converged,
        fit.message,
        0.0,
        fit.iterations,
        fit,
        uncertainty(fit, records),
        tuple(one.log_likelihood for one in fits),
    )


def _further_starts(
    model: Model, records: Sequence[Record], count: int, seed: int, limits: Limits | None
) -> list[Model]:
    random = np.random.default_rng(seed)
    free, values = model.free_parameters(), model.parameter_values()
    low, high = bounds(model, free, limits)
    centre = np.array([values[n] for n in free])
    return [
        model.with_values(
            dict(
                zip(
                    free, np.clip(centre * SPREAD ** random.uniform(-1, 1, len(free)), low, high), strict=True
                )
            )
        )
        for _ in range(count)
    ]


def _output_error(
    model: Model, datasets: Sequence[DataSet], at_rest: bool, limits: Limits | None
) -> Estimate:
    found = least_squares(model, [(d, choose_windows(model, d)) for d in datasets], limits, at_rest)
    message = "converged" if found.converged else f"stopped at its limit of {found.evaluations} evaluations"
    if found.fled:
        message += f"; {', '.join(found.fled)} fled: the structure cannot follow the recording"
    return Estimate(
        found.model,
        model,
        "output-error",
        found.converged and not found.fled,
        message,
        0.0,
        found.evaluations,
    )


def _progressive(
    model: Model, datasets: Sequence[DataSet], at_rest: bool, limits: Limits | None, progress: Progress | None
) -> Estimate:
    """Thesis 3.2.3: the linear model where friction matters least, then the whole one on a growing
    stretch."""
    linear = without_nonlinear(model)
    iterations = 0
    lively = [liveliest(d, STRETCHES[0]) for d in datasets]
    if linear.free_parameters():
        if progress is not None:
            progress("linear model", 0.1)
        found = least_squares(
            linear, [(d, cut(d, None, "")) for d in lively], _within(limits, linear), at_rest
        )
        iterations += found.evaluations
        values = found.model.parameter_values()
        model_now = model.with_values({n: values[n] for n in linear.free_parameters() if n in values})
    else:
        model_now = model
    converged, message = True, ""
    for number, share in enumerate(STRETCHES, start=1):
        if progress is not None:
            progress(f"{100 * share:.0f} % of the recording", 0.1 + 0.9 * (number - 1) / len(STRETCHES))
        parts = [d.between(d.start, d.start + share * (len(d) - 1) * d.dt) for d in datasets]
        found = least_squares(model_now, [(d, choose_windows(model_now, d)) for d in parts], limits, at_rest)
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


def _within(limits: Limits | None, model: Model) -> Limits | None:
    return None if limits is None else {n: b for n, b in limits.items() if n in model.parameter_values()}
