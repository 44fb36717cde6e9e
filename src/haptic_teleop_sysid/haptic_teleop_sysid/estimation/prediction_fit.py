"""Parameters by damped Gauss-Newton on the prediction errors, at given noise levels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model

from .fit import Fit, ends_with_its_model
from .gauss_newton import Damping, Equations, Problem, maximise
from .likelihood import FAILURES, innovations, likelihood_of, log_likelihood
from .noise import NoiseModel
from .records import Record
from .step_limits import Limits, at_bound, bounds, clipped_step, most_substeps, substeps
from .whitening import whiten

FloatArray = NDArray[np.float64]

#: From this damping on a step may well gain nothing, and its derivatives are not worth their time.
_DOUBTFUL = 1e-3
_DAMPING = Damping(first=1e-6, raised=1e-4, least=1e-9, tries=8)
#: Derivatives beyond this are taken for diverged.
OVERFLOW = 1e120


def normal_equations(
    model: Model, noise: NoiseModel, records: Sequence[Record], free: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, float]:
    """Information (p, p) and gradient (p,) of the negative log-likelihood, and the log-likelihood: zeros and
    -inf where the model predicts nothing, or its numbers are beyond linear algebra."""
    try:
        found = _normal_equations(model, noise, records, free)
    except FAILURES:
        found = None
    if found is None or not (np.all(np.isfinite(found[0])) and np.all(np.isfinite(found[1]))):
        return np.zeros((len(free), len(free))), np.zeros(len(free)), -np.inf
    return found


def _normal_equations(
    model: Model, noise: NoiseModel, records: Sequence[Record], free: tuple[str, ...]
) -> tuple[FloatArray, FloatArray, float]:
    packed = pack(model)
    information, gradient = np.zeros((len(free), len(free))), np.zeros(len(free))
    predictions = [innovations(packed, noise, r, free) for r in records]
    value = log_likelihood(packed, records, [p.innovation for p in predictions])
    if not np.isfinite(value):
        return information, gradient, -np.inf
    for record, prediction in zip(records, predictions, strict=True):
        # The derivatives may overflow although the prediction does not, where the observer is nearly
        # unstable.
        if not np.max(np.abs(prediction.d_innovation), initial=0.0) < OVERFLOW:
            return np.zeros_like(information), np.zeros_like(gradient), -np.inf
        whitened, jacobian = whiten(packed, record, prediction.innovation, prediction.d_innovation)
        information += jacobian.T @ jacobian
        gradient += jacobian.T @ whitened
    return information, gradient, value


@dataclass(frozen=True)
class _Point:
    """A model, the likelihood that it has, and its equations where they came with that."""

    model: Model
    value: float
    equations: Equations | None


@ends_with_its_model
def fit_parameters(
    model: Model,
    noise: NoiseModel,
    records: Sequence[Record],
    *,
    free: tuple[str, ...] | None = None,
    iterations: int = 20,
    tolerance: float = 1e-3,
    progress: Callable[[int, float], None] | None = None,
    limits: Limits | None = None,
) -> Fit:
    """Maximise the likelihood over the free parameters of the model at a given noise model.

    Starts from the model's values (moved inside their bounds).  Ends when a step promises less than
    ``tolerance`` nats or gains less than a tenth of that, or when no damped step gains anything.
    """
    names = model.free_parameters() if free is None else free
    low, high = bounds(model, names, limits)
    values = model.parameter_values()
    theta = np.clip(np.array([values[n] for n in names], dtype=float), low, high)
    model = model.with_values(dict(zip(names, theta, strict=True)))
    allowed = most_substeps(model, records)

    def at(theta: FloatArray, before: _Point, damping: float) -> _Point | None:
        model = before.model.with_values(dict(zip(names, theta, strict=True)))
        if substeps(model, records) > allowed:
            return None
        if damping >= _DOUBTFUL:
            return _Point(model, likelihood_of(pack(model), noise, records), None)
        *found, value = normal_equations(model, noise, records, names)
        return _Point(model, value, (found[0], found[1]))

    def equations(point: _Point, theta: FloatArray) -> Equations:
        return point.equations or normal_equations(point.model, noise, records, names)[:2]

    def limited(point: _Point, theta: FloatArray, new: FloatArray) -> FloatArray:
        return clipped_step(point.model, names, theta, new, records)

    *found, value = normal_equations(model, noise, records, names)
    start = _Point(model, value, (found[0], found[1]))
    if not np.isfinite(value):
        message = "the start does not predict anything"
        return Fit(model, noise, names, value, found[0], found[1], False, 0, message)
    end = maximise(
        Problem(at, equations, limited, low, high),
        theta,
        start,
        _DAMPING,
        iterations=iterations,
        enough=tolerance,
        progress=progress,
    )
    return Fit(
        end.point.model,
        noise,
        names,
        end.point.value,
        *equations(end.point, end.theta),
        end.converged,
        end.count,
        end.message,
        at_bound(names, end.theta, low, high),
    )
