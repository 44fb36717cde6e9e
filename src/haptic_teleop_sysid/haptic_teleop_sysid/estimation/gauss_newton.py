"""Parameters by damped Gauss-Newton on the prediction errors, at given noise levels."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.compiled import njit
from haptic_teleop_sim.kernel import Packed, pack
from haptic_teleop_sim.model import STRUCTURES, Model

from .descent import Damping, Equations, Problem, maximise
from .likelihood import (
    FAILURES,
    channels,
    covariance,
    innovations,
    likelihood_of,
    log_likelihood,
    seen,
    settled,
)
from .noise import NoiseModel
from .records import Record

FloatArray = NDArray[np.float64]
Answer = TypeVar("Answer")

#: A parameter of the structure moves at most by this factor in one step.
_LARGEST_FACTOR = 4.0
#: From this damping on a step may well gain nothing, and its derivatives are not worth their time.
_DOUBTFUL = 1e-3
_DAMPING = Damping(first=1e-6, raised=1e-4, least=1e-9, tries=8)
#: A trial stiffer than this (steps per sample), and four times stiffer than the start, is not worth its time.
_MOST_SUBSTEPS = 32
#: Derivatives beyond this are taken for diverged.
OVERFLOW = 1e120


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    ``log_likelihood`` of the recordings; ``information`` (p, p): Gauss-Newton information matrix of
    ``free`` at the end; ``gradient`` (p,); ``converged`` with a sentence in ``message``.
    """

    model: Model
    noise: NoiseModel
    free: tuple[str, ...]
    log_likelihood: float
    information: FloatArray
    gradient: FloatArray
    converged: bool
    iterations: int
    message: str
    at_bound: tuple[str, ...] = field(default=())
    _asked: dict[Hashable, Any] = field(default_factory=dict, init=False, compare=False, repr=False)

    def once(
        self, question: Hashable, records: Sequence[Record], answer: Callable[[], Answer]
    ) -> Answer:
        """The answer to a question about this fit and some records, which several steps of a diagnosis ask:
        computed when it is asked first. A copy by `replace` knows nothing yet."""
        key = question, tuple(map(id, records))
        if key not in self._asked:
            self._asked[key] = answer(), tuple(records)  # kept: another record could get the same identity
        found: Answer = self._asked[key][0]
        return found


def ends_with_its_model(fit: Callable[..., Fit]) -> Callable[..., Fit]:
    """A fit whose arithmetic fails (FAILURES) is one that predicts nothing: the search goes on without it."""

    @wraps(fit)
    def guarded(model: Model, noise: NoiseModel, records: Sequence[Record], **more: Any) -> Fit:
        try:
            return fit(model, noise, records, **more)
        except FAILURES as failure:
            free = model.free_parameters() if more.get("free") is None else more["free"]
            nothing = np.zeros((len(free), len(free)))
            why = f"its arithmetic failed: {failure}"
            return Fit(model, noise, free, -np.inf, nothing, nothing.sum(axis=0), False, 0, why)

    return guarded


#: Bounds of one's own by parameter name: (lowest, highest).
Limits = Mapping[str, tuple[float, float]]


def bounds(model: Model, free: Sequence[str], own: Limits | None = None) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest allowed value of each free parameter, (p,), (p,): the physical ones, narrowed by
    ``own``."""
    limits = {
        f"{e.location}.{e.effect}.{p.name}": (p.minimum, p.maximum)
        for e in model.effects
        for p in e.entry.parameters
    }
    for name in STRUCTURES[model.structure]:
        positive = name in ("torque_constant", "stiffness", "motor_inertia", "arm_inertia")
        limits[name] = (1e-12 if positive else 0.0, np.inf)
    for name, (low, high) in (own or {}).items():
        if name in limits:
            limits[name] = (max(low, limits[name][0]), min(high, limits[name][1]))
    lowest, highest = zip(*(limits[name] for name in free), strict=True) if free else ((), ())
    return np.array(lowest, dtype=float), np.array(highest, dtype=float)


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


def whiten(
    packed: Packed,
    record: Record,
    innovation: FloatArray,
    slope: FloatArray,
    reference: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Innovations (m,) and their derivatives (m, p) in units of their standard deviation (or that of
    ``reference`` (n, 2)), channels decorrelated; of the innovations (n, 2) and their derivatives (n, 2, p).
    Zero where a reading is missing, which has no score.
    """
    used = len(channels(packed, record))
    spread = covariance(packed, record, innovation if reference is None else reference)
    weight = np.asarray(np.linalg.inv(np.linalg.cholesky(spread)).T, dtype=np.float64)
    e = settled(record, innovation)[:, :used] @ weight
    jacobian = _decorrelated(settled(record, slope), weight)
    there = settled(record, seen(packed, record))[:, :used]
    if not there.all():
        part = there.astype(np.float64)
        if used == 2:  # the arm's reading alone, in units of its own standard deviation
            part[there[:, 1] & ~there[:, 0], 1] = 1.0 / (weight[1, 1] * np.sqrt(spread[1, 1]))
        e, jacobian = e * part, jacobian * part.reshape(-1, 1)
    return e.reshape(-1), jacobian


@njit(cache=True, error_model="numpy", nogil=True)
def _decorrelated(slope: FloatArray, weight: FloatArray) -> FloatArray:
    """slope (n, 2, p) times the upper triangular weight (1, 1) or (2, 2), as (m, p); in one pass, where a
    product of stacks would go over the memory a dozen times."""
    n, _, p = slope.shape
    used = len(weight)
    found = np.empty((n * used, p))
    for k in range(n):
        for j in range(p):
            found[k * used, j] = slope[k, 0, j] * weight[0, 0]
        if used == 2:
            for j in range(p):
                found[2 * k + 1, j] = slope[k, 1, j] * weight[1, 1] + weight[0, 1] * slope[k, 0, j]
    return found


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


def at_bound(names: Sequence[str], theta: FloatArray, low: FloatArray, high: FloatArray) -> tuple[str, ...]:
    """Names of the parameters that ended at their bounds, all (p,) or longer."""
    return tuple(n for n, t, a, b in zip(names, theta, low, high, strict=False) if t <= a or t >= b)


def clipped_step(
    model: Model, names: Sequence[str], theta: FloatArray, new: FloatArray, records: Sequence[Record]
) -> FloatArray:
    """``new`` (p,) brought as near to ``theta`` (p,) as one step may go: a positive quantity changes by a
    factor, a torque by as much as acts."""
    factors = np.array([_scales(model, n) for n in names], dtype=bool)
    limit = np.maximum(np.abs(theta), 1e-12)
    lowest, highest = theta - limit * (1 - 1 / _LARGEST_FACTOR), theta + limit * (_LARGEST_FACTOR - 1)
    near = np.where(factors, np.clip(new, lowest, highest), new)
    reach = np.array([_reach(model, n, records) for n in names])
    farthest = np.maximum(3 * np.abs(theta), reach)
    return np.clip(near, theta - farthest, theta + farthest)


def most_substeps(model: Model, records: Sequence[Record]) -> int:
    """Steps per sample beyond which a trial from ``model`` is not worth its time."""
    return max(_MOST_SUBSTEPS, 4 * substeps(model, records))


def substeps(model: Model, records: Sequence[Record]) -> int:
    """Steps per sample that the model's stiffness asks for."""
    packed = pack(model)
    return max(packed.substeps(record.dt) for record in records)


def _scales(model: Model, name: str) -> bool:
    """Whether a parameter is a positive quantity without which the model has no meaning: it changes in
    factors."""
    if name in STRUCTURES[model.structure]:
        return True
    parameter = _effect_parameter(model, name)
    return parameter is not None and parameter.neutral is None and parameter.minimum > 0.0


def _reach(model: Model, name: str, records: Sequence[Record]) -> float:
    """How far one step may go from zero: for a torque as much as acts, else without limit."""
    parameter = _effect_parameter(model, name)
    if parameter is None or parameter.scale != "torque":
        return np.inf
    return float(np.max([np.std(r.input) for r in records])) * model.parameters["torque_constant"]


def _effect_parameter(model: Model, name: str):
    for effect in model.effects:
        head = f"{effect.location}.{effect.effect}."
        if name.startswith(head):
            return effect.entry.parameter(name.removeprefix(head))
    return None
