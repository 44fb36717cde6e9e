"""Parameters and noise levels together by damped Gauss-Newton on the prediction errors.

Fitting parameters at held levels and levels at held parameters, in turn, stops on ridges: a torque that is
twice as strong but forgotten four times as fast predicts nearly alike, and a larger inertia wants a larger
disturbance beside it.  It ends tens to hundreds of nats below the top, and what is left there hides small
effects and imitates others.  The observer's gain makes the innovations a smooth function of everything, so
everything is fitted at once (Ljung, System Identification, 1999, ch. 7 and 10.2), with exact derivatives but
for those of the gain itself, which are differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed, pack
from haptic_teleop_sim.model import STRUCTURES, Model, parameter_bounds

from .fit import Fit, ends_with_its_model
from .gauss_newton import Damping, Equations, Problem, maximise
from .likelihood import FAILURES, channels, innovations, log_likelihood
from .noise import NoiseModel, observer_gain
from .parallel import side_by_side
from .prediction_fit import OVERFLOW
from .records import Record, thinned_to
from .step_limits import Limits, at_bound, bounds, clipped_step, most_substeps, substeps
from .tuning import LEVELS, initial_noise, level_bounds
from .whitening import whiten

FloatArray = NDArray[np.float64]

#: Step of the differences, relative: large against the rounding of the gain, small against its curvature.
_STEP = 1e-3
_TIMES = ("motor_time", "arm_time")
#: No level changes by more than this factor in one step.
_LARGEST_FACTOR = 16.0
_DAMPING = Damping(first=1e-4, raised=1e-3, least=1e-8, tries=6)
#: Correlation times of the disturbances at motor and arm from which a fit starts that knows nothing of the
#: noise, s: one start alone stops now and then a hundred nats below the top.
START_TIMES = ((1.0, 1.0), (0.1, 0.1), (0.003, 0.3))


@dataclass(frozen=True)
class _Point:
    """A model with noise levels, and what it predicts."""

    model: Model
    noise: NoiseModel
    value: float
    errors: list[FloatArray]


@ends_with_its_model
def fit_whole(
    model: Model,
    noise: NoiseModel,
    records: Sequence[Record],
    *,
    free: tuple[str, ...] | None = None,
    iterations: int = 10,
    enough: float = 0.3,
    limits: Limits | None = None,
    known: FloatArray | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Fit:
    """Maximise the likelihood over the free parameters (all of the model's by default, none for an empty
    tuple) and the noise levels; ends when a step promises less than ``enough`` nats.

    The information of the result is that of the parameters with the levels projected out.  ``known`` (p, p):
    information that other recordings have about the parameters, whose best values are the model's: it counts
    like these records (so the result's likelihood is a posterior, and its information contains it).
    """
    names = model.free_parameters() if free is None else free
    levels = fitted_levels(model, records)
    low, high = _box(model, names, levels, records, limits)
    values = model.parameter_values()
    theta = np.array([values[n] for n in names] + [np.log(getattr(noise, n)) for n in levels])
    theta = np.clip(theta, low, high)
    p = len(names)
    known = np.zeros((p, p)) if known is None else known
    center = theta[:p].copy()

    def at(before: Model, noise: NoiseModel, theta: FloatArray, allowed: float = np.inf) -> _Point | None:
        found = _at(before, noise, names, levels, theta, records, allowed)
        away = theta[:p] - center
        return None if found is None else replace(found, value=found.value - 0.5 * float(away @ known @ away))

    point = at(model, noise, theta)
    if point is None:
        nothing = np.zeros((p, p))
        return Fit(
            model,
            noise,
            names,
            -np.inf,
            nothing,
            np.zeros(p),
            False,
            0,
            "the start does not predict anything",
        )
    allowed = most_substeps(model, records)

    def equations(point: _Point, theta: FloatArray) -> Equations | None:
        found = _equations(point, names, levels, len(theta), records)
        if found is None:
            return None
        information, gradient = found
        information[:p, :p] += known
        gradient[:p] += known @ (theta[:p] - center)
        return information, gradient

    def limited(point: _Point, theta: FloatArray, new: FloatArray) -> FloatArray:
        near = clipped_step(point.model, names, theta[:p], new[:p], records)
        reach = np.log(_LARGEST_FACTOR)
        return np.concatenate(
            [np.clip(near, low[:p], high[:p]), np.clip(new[p:], theta[p:] - reach, theta[p:] + reach)]
        )

    problem = Problem(
        lambda theta, before, damping: at(before.model, before.noise, theta, allowed),
        equations,
        limited,
        low,
        high,
    )
    end = maximise(problem, theta, point, _DAMPING, iterations=iterations, enough=enough, progress=progress)
    return Fit(
        end.point.model,
        end.point.noise,
        names,
        end.point.value,
        _without_levels(end.information, p),
        end.gradient[:p],
        end.converged,
        end.count,
        end.message,
        at_bound(names, end.theta, low, high),
    )


def fit_from_scratch(
    model: Model, records: Sequence[Record], *, limits: Limits | None = None, iterations: int = 30
) -> Fit:
    """`fit_whole` with nothing known of the noise: the best that comes of START_TIMES. The way there is made
    on thinned recordings where they are long."""
    few = thinned_to(records)
    fits = side_by_side(
        lambda noise: fit_whole(model, noise, few, iterations=iterations, limits=limits),
        noise_starts(model, few),
    )
    best = max(fits, key=lambda fit: fit.log_likelihood)
    if few is records or not np.isfinite(best.log_likelihood):
        return best
    return fit_whole(best.model, best.noise, records, iterations=iterations, limits=limits)


def noise_starts(model: Model, records: Sequence[Record]) -> list[NoiseModel]:
    """Noise models to start from where nothing is known of the noise."""
    start = initial_noise(pack(model), records)
    return [replace(start, motor_time=motor, arm_time=arm) for motor, arm in START_TIMES]


def fitted_levels(model: Model, records: Sequence[Record]) -> list[str]:
    """Levels that the recordings can tell anything about; the motor's encoder is their unit, because all of
    them scaled alike give the same observer."""
    names = [n for n in LEVELS if n != "motor_angle" and not (model.rigid and n.startswith("arm"))]
    packed = pack(model)
    if not any(1 in channels(packed, record) for record in records):
        names = [n for n in names if n != "arm_angle"]
    return names


def _box(
    model: Model,
    names: Sequence[str],
    levels: Sequence[str],
    records: Sequence[Record],
    limits: Limits | None,
) -> tuple[FloatArray, FloatArray]:
    low, high = bounds(model, names, limits)
    allowed = level_bounds(pack(model), records)
    edges = np.log([allowed[n] for n in levels]).reshape(-1, 2)
    return np.concatenate([low, edges[:, 0]]), np.concatenate([high, edges[:, 1]])


def _at(
    model: Model,
    noise: NoiseModel,
    names: Sequence[str],
    levels: Sequence[str],
    theta: FloatArray,
    records: Sequence[Record],
    allowed: float = np.inf,
) -> _Point | None:
    """The point, or None where it predicts nothing (or costs more substeps than ``allowed``)."""
    p = len(names)
    model = model.with_values(dict(zip(names, theta[:p].tolist(), strict=True)))
    noise = replace(noise, **dict(zip(levels, np.exp(theta[p:]).tolist(), strict=True)))
    if substeps(model, records) > allowed:
        return None
    found = _errors(model, noise, records)
    return None if found is None else _Point(model, noise, *found)


def _errors(
    model: Model, noise: NoiseModel, records: Sequence[Record]
) -> tuple[float, list[FloatArray]] | None:
    """Likelihood and innovations."""
    packed = pack(model)
    try:
        errors = [innovations(packed, noise, r).innovation for r in records]
        value = log_likelihood(packed, records, errors)
    except FAILURES:
        return None
    return (value, errors) if np.isfinite(value) else None


def _equations(
    point: _Point, names: tuple[str, ...], levels: Sequence[str], size: int, records: Sequence[Record]
) -> tuple[FloatArray, FloatArray] | None:
    """Information (size, size) and gradient of the negative log-likelihood by parameters and logarithms of
    levels."""
    packed = pack(point.model)
    information, gradient = np.zeros((size, size)), np.zeros(size)
    for k, record in enumerate(records):
        try:
            moving = _gain_slopes(point, names, levels, packed, record)
            slopes = innovations(packed, point.noise, record, names, gain_slopes=moving).d_innovation
            if not np.max(np.abs(slopes), initial=0.0) < OVERFLOW:
                return None
            whitened, jacobian = whiten(packed, record, point.errors[k], slopes)
        except FAILURES:
            return None
        information += jacobian.T @ jacobian
        gradient += jacobian.T @ whitened
    return (information, gradient) if np.all(np.isfinite(information)) else None


def _gain_slopes(
    point: _Point, names: Sequence[str], levels: Sequence[str], packed: Packed, record: Record
) -> tuple[FloatArray, FloatArray]:
    """How the observer's gain (states, 2, columns) and the decay of its disturbances (2, columns) depend on
    the structure's parameters and on the logarithms of the levels, the first by differences."""
    noise, dt, measured = point.noise, record.dt, channels(packed, record)
    gain = observer_gain(packed, noise, dt, measured)
    columns = len(names) + len(levels)
    d_gain, d_decay = np.zeros((len(gain), 2, columns)), np.zeros((2, columns))
    for i, name in enumerate(names):
        beside = _beside(point.model, packed, name)
        if beside is not None:
            changed, step = beside
            d_gain[:, :, i] = (observer_gain(changed, noise, dt, measured) - gain) / step
        channel = packed.delayed_encoder(name)
        if channel is not None:
            lead = packed.encoder_shift(dt)[1]
            lead[channel] -= _STEP * dt
            d_gain[:, :, i] = (observer_gain(packed, noise, dt, measured, lead) - gain) / (_STEP * dt)
    for i, name in enumerate(levels, start=len(names)):
        there = noise.scaled(**{name: float(np.exp(_STEP))})
        d_gain[:, :, i] = (observer_gain(packed, there, dt, measured) - gain) / _STEP
        if name in _TIMES:
            place = _TIMES.index(name)
            d_decay[place, i] = noise.decay(dt)[place] * dt / getattr(noise, name)
    return d_gain, d_decay


def _beside(model: Model, packed: Packed, name: str) -> tuple[Packed, float] | None:
    """The model at a parameter a little beside its value, and by how much; None where the observer's gain
    does not depend on that."""
    of_structure = name in STRUCTURES[model.structure] and name != "torque_constant"
    known = (e for e in model.effects if e.entry.spring or e.entry.slope)
    if not of_structure and not any(name.startswith(f"{e.location}.{e.effect}.") for e in known):
        return None
    value = model.parameter_values()[name]
    step = _STEP * max(abs(value), 1e-6)
    if value + step > parameter_bounds(model, name)[1]:
        step = -step
    there = pack(model.with_values({name: value + step}))
    same = there.linear == packed.linear and there.encoder_slope == packed.encoder_slope
    return None if same else (there, step)


def _without_levels(information: FloatArray, p: int) -> FloatArray:
    """Information (p, p) of the parameters when the levels are unknown, too (Schur complement)."""
    cross, own = information[:p, p:], information[p:, p:]
    return information[:p, :p] - cross @ np.linalg.pinv(own, rcond=1e-10, hermitian=True) @ cross.T
