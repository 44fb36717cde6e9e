"""How sure the estimated parameters are, and which of them the recordings cannot determine.

    V = H^-1 M H^-1,   H = sum J' J,   M = sum over lags of (1 - |k|/(L+1)) sum_t s_t s_(t+k)',  s_t = J_t'
    e_t

e: whitened innovations, J: their derivatives.  This is the sandwich of a misspecified likelihood (White,
Econometrica 50, 1982) with the lag window of Newey and West (Econometrica 55, 1987): it holds also where the
innovations are not quite white, as behind an encoder that steps, where H^-1 alone is too sure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.errors import ModelError
from haptic_teleop_sim.kernel import Packed, pack
from haptic_teleop_sim.model import STRUCTURES, parameter_bounds
from haptic_teleop_sysid.simulation.covariance import deviations, scaled_inverse, score_covariance

from .fit import Fit
from .likelihood import channels, innovations, settling
from .noise import NoiseModel, observer_gain
from .records import Record
from .whitening import whiten

FloatArray = NDArray[np.float64]

#: s; correlation of the scores is counted up to this lag.
MEMORY = 0.1
#: Relative step of a derivative through the observer's gain.
STEP = 1e-3
#: A direction of the scaled information this much weaker than the strongest cannot be told from rounding.
SINGULAR = 1e-9
#: Beyond this relative standard deviation a quantity that cannot be zero is called undetermined.
VAGUE = 0.5
_LEVEL = "noise level"
QUANTILE_95 = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True)
class Uncertainty:
    """Of the parameters ``names`` (p): ``std`` (p,), inf where undetermined; ``correlation`` (p, p), NaN
    there; ``information_std`` (p,) what the information matrix alone says; ``undetermined``: name -> why,
    in words; ``near_zero``: names that may as well be zero; ``condition`` of the information scaled to unit
    diagonal; ``combined``: of the undetermined those of which a combination is known."""

    names: tuple[str, ...]
    std: FloatArray
    correlation: FloatArray
    information_std: FloatArray
    undetermined: dict[str, str]
    near_zero: tuple[str, ...]
    condition: float
    combined: tuple[str, ...] = ()

    def interval(self, name: str, value: float) -> tuple[float, float] | None:
        """95 % interval about a value; None where undetermined."""
        if name in self.undetermined:
            return None
        half = QUANTILE_95 * float(self.std[self.names.index(name)])
        return value - half, value + half


def uncertainty(
    fit: Fit, records: Sequence[Record], memory: float = MEMORY, tuned: bool = True
) -> Uncertainty:
    """Standard errors, correlations and what is undetermined, at a fit of ``records``.

    ``memory``: s over which the innovations may be correlated; ``tuned``: the noise levels were estimated
    from the same data, and what they may still vary makes the parameters less sure.
    """
    names = fit.free
    packed = pack(fit.model)
    levels = _levels(packed) if tuned else ()
    p = len(names) + len(levels)
    information, meat = np.zeros((p, p)), np.zeros((p, p))
    for record in records:
        prediction = innovations(packed, fit.noise, record, names)
        columns = [_by_level(packed, fit.noise, record, level) for level in levels]
        by_gain = np.stack([_through_gain(fit, packed, record, name) for name in names], axis=2)
        slopes = prediction.d_innovation + by_gain
        whole = np.concatenate([slopes, *(c[:, :, None] for c in columns)], axis=2)
        prediction = replace(prediction, d_innovation=whole)
        whitened, jacobian = whiten(packed, record, prediction.innovation, prediction.d_innovation)
        width = len(whitened) // len(prediction.innovation[settling(record) :])
        scores = (jacobian * whitened[:, None]).reshape(-1, width, p).sum(axis=1)
        n = len(scores)
        lags = max(round(memory / record.dt), int(4.0 * (n / 100.0) ** (2.0 / 9.0)))
        information += jacobian.T @ jacobian
        meat += score_covariance(scores, min(lags, n // 10))
    return _judge(fit, information, meat)


def _levels(packed: Packed) -> tuple[str, ...]:
    motor = ("motor_torque", "motor_angle", "motor_time")
    return motor if packed.rigid else (*motor, "arm_torque", "arm_angle", "arm_time")


def _by_level(packed: Packed, noise: NoiseModel, record: Record, level: str) -> FloatArray:
    """Derivative (n, 2) of the innovations by the logarithm of a noise level, by central differences; zero
    where the observer does not exist for one of them."""
    noises = [noise.scaled(**{level: float(np.exp(sign * STEP))}) for sign in (1.0, -1.0)]
    return _slope([(packed, one) for one in noises], packed, noise, record, STEP)


def _through_gain(fit: Fit, packed: Packed, record: Record, name: str) -> FloatArray:
    """Derivative (n, 2) of the innovations by a parameter in so far as it changes the observer's gain,
    which the exact derivatives hold. Without it a scale common to all torques seems to show, and it does
    not."""
    channel = packed.delayed_encoder(name)
    if channel is not None:
        # Within its sample: where a delay passes a whole one, the readings are moved, and the gain jumps.
        return _by_lead(packed, fit.noise, record, channel)
    value = fit.model.parameter_values()[name]
    step = STEP * max(abs(value), 1e-9)
    low, high = parameter_bounds(fit.model, name)
    # Below zero nothing is physical, and beyond its bounds nothing is allowed: the step then goes one way.
    values = (
        value + step if value + step <= high else value,
        value - step if value - step > max(low, 0.0) else value,
    )
    changed = [(pack(fit.model.with_values({name: v})), fit.noise) for v in values]
    return _slope(changed, packed, fit.noise, record, 0.5 * (values[0] - values[1]))


def _by_lead(packed: Packed, noise: NoiseModel, record: Record, channel: int) -> FloatArray:
    """Derivative (n, 2) of the innovations by an encoder's delay in so far as it changes the gain."""
    step, gains = STEP * record.dt, []
    for sign in (-1.0, 1.0):
        lead = packed.encoder_shift(record.dt)[1]
        lead[channel] += sign * step
        gains.append(observer_gain(packed, noise, record.dt, channels(packed, record), lead))
    runs = [innovations(packed, noise, record, gain=gain).innovation for gain in gains]
    slope = (runs[0] - runs[1]) / (2.0 * step)
    return slope if np.all(np.isfinite(slope)) else np.zeros((len(record), 2))


def _slope(
    pairs: Sequence[tuple[Packed, NoiseModel]], packed: Packed, noise: NoiseModel, record: Record, step: float
) -> FloatArray:
    """Central difference (n, 2) of the innovations between the gains of two models with noise; zero where
    one of them has none."""
    used = channels(packed, record)
    try:
        gains = [observer_gain(model, levels, record.dt, used) for model, levels in pairs]
        runs = [
            innovations(packed, levels, record, gain=gain).innovation
            for gain, (_, levels) in zip(gains, pairs, strict=True)
        ]
    except (np.linalg.LinAlgError, ValueError, ModelError):
        return np.zeros((len(record), 2))
    slope = (runs[0] - runs[1]) / (2.0 * step)
    return slope if np.all(np.isfinite(slope)) else np.zeros((len(record), 2))


def _judge(fit: Fit, information: FloatArray, meat: FloatArray) -> Uncertainty:
    names, p = fit.free, len(information)
    everything = (*names, *(f"{_LEVEL} {i}" for i in range(p - len(names))))
    undetermined: dict[str, str] = {}
    combined: list[str] = []
    scale = np.sqrt(np.maximum(np.diag(information), 0.0))
    seen = scale > 1e-150
    for name in np.array(everything, dtype=object)[~seen]:
        undetermined[name] = "nothing in the recording depends on it"
    index = np.flatnonzero(seen)
    s, inverse, unseen = scaled_inverse(information[np.ix_(index, index)], SINGULAR * max(len(index), 1))
    for direction in unseen.T:
        combined += _singular(everything, index, direction, undetermined)
    bread = np.zeros((p, p))
    bread[np.ix_(index, index)] = inverse / np.outer(s, s)
    count = len(names)
    covariance = (bread @ meat @ bread)[:count, :count]
    bread = bread[:count, :count]
    condition = _condition(bread) if not undetermined.keys() & set(names) else float("inf")
    undetermined = {name: why for name, why in undetermined.items() if name in names}
    std, plain = deviations(covariance), deviations(bread)
    # Overlapping windows may underrate: never surer than the information itself.
    std = np.maximum(std, plain)
    near_zero = _told_apart(fit, std, undetermined)
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance / np.outer(np.sqrt(np.diag(covariance)), np.sqrt(np.diag(covariance)))
    for i, name in enumerate(names):
        if name in undetermined:
            std[i] = plain[i] = np.inf
            correlation[i, :] = correlation[:, i] = np.nan
    together = tuple(name for name in names if name in combined)
    return Uncertainty(names, std, correlation, plain, undetermined, near_zero, condition, together)


def widened(unsure: Uncertainty, fit: Fit, further: Mapping[str, float]) -> Uncertainty:
    """The uncertainty of a fit with ``further`` standard deviations, by parameter, that are independent of
    it: what is undetermined or near zero is judged anew."""
    std = np.hypot(unsure.std, [further.get(name, 0.0) for name in unsure.names])
    undetermined = dict(unsure.undetermined)
    near_zero = _told_apart(fit, std, undetermined)
    lost = np.array([name in undetermined for name in unsure.names])
    correlation = np.where(lost[:, None] | lost[None, :], np.nan, unsure.correlation)
    return replace(
        unsure,
        std=np.where(lost, np.inf, std),
        information_std=np.where(lost, np.inf, unsure.information_std),
        correlation=correlation,
        undetermined=undetermined,
        near_zero=near_zero,
    )


def _told_apart(fit: Fit, std: FloatArray, undetermined: dict[str, str]) -> tuple[str, ...]:
    """Names that may as well be zero at these standard deviations; what is not determined is added to
    ``undetermined``."""
    values, near_zero = fit.model.parameter_values(), []
    for i, name in enumerate(fit.free):
        if name in undetermined:
            continue
        value = abs(values[name])
        if name in fit.at_bound:
            undetermined[name] = "it ends at its bound"
        elif _may_vanish(fit, name):
            if value < 2.0 * std[i]:
                near_zero.append(name)
        elif std[i] > VAGUE * value:
            share = 100.0 * std[i] / max(value, 1e-300)
            undetermined[name] = f"its standard deviation is {share:.0f} % of its value"
    return tuple(near_zero)


def _condition(bread: FloatArray) -> float:
    """Condition of the parameters' inverse information, noise levels eliminated, scaled to unit diagonal."""
    scale = deviations(bread)
    if not len(bread) or not np.all(scale > 0.0):
        return float("inf")
    return float(np.linalg.cond(bread / np.outer(scale, scale)))


def _singular(
    names: tuple[str, ...], index: NDArray[np.intp], direction: FloatArray, told: dict[str, str]
) -> list[str]:
    """Tell of each parameter that moves along a direction in which the recording sees nothing; their names
    where they are several."""
    part = [names[index[i]] for i in np.flatnonzero(np.abs(direction) > 1e-3 * np.max(np.abs(direction)))]
    # Noise levels come along in many a direction, and nobody can fix one of them.
    part = [name for name in part if not name.startswith(_LEVEL)] or part
    for name in part:
        others = [other for other in part if other != name]
        told[name] = (
            f"changing it together with {', '.join(others)} changes nothing that was recorded: fix one of "
            "them"
            if others
            else "nothing in the recording depends on it"
        )
    return part if len(part) > 1 else []


def _may_vanish(fit: Fit, name: str) -> bool:
    """Whether zero is a physical value at which the rest of the model still makes sense."""
    if name in STRUCTURES[fit.model.structure]:
        return name.endswith("_damping")
    for effect in fit.model.effects:
        head = f"{effect.location}.{effect.effect}."
        if name.startswith(head):
            parameter = effect.entry.parameter(name.removeprefix(head))
            return parameter.neutral == 0.0
    return False
