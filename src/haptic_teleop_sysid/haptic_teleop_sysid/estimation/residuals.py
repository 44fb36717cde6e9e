"""What the one-step prediction errors of a model say: are they white, and do they depend on past inputs?

    r_e(k) = mean(e_t e_(t+k)) / r_e(0),   r_ue(k) = mean(u_t e_(t+k)) / (std u · std e)

For a model that explains everything r_e vanishes beyond k = 0 and r_ue for k > 0, up to +-2.58/sqrt(n) in
99 of 100 lags (Ljung, System Identification, 1999, section 16.6).  u is whitened first, so that one
dependency does not show at all lags, and that bound holds.  Under feedback, r_ue at k < 0 tells of the
controller, not of the model.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.correlation import autocorrelation, correlation
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import after_settling, channels, innovations
from haptic_teleop_sysid.estimation.records import Record, records_from
from haptic_teleop_sysid.estimation.tuning import initial_noise, tune_noise
from haptic_teleop_sysid.recordings.dataset import DataSet

Array = NDArray[np.float64]
QUANTILE_99 = 2.576
FEWEST_SAMPLES = 200
"""Samples below which correlations over 50 lags say nothing."""
UNDER_FEEDBACK = (
    "The recording was made in closed loop: correlation at negative lags is the controller answering the "
    "disturbance "
    "and says nothing against the model; read the positive lags."
)
ORDER = 20
"""Of the autoregressive filter that whitens the input."""


@dataclass(frozen=True)
class Residuals:
    """Of one encoder: lags (2 m + 1,) in samples; auto, cross (2 m + 1,) normalised; bound: 99 % of a
    correct model's values; outside: (share of positive lags of auto, of cross) beyond it; rms in rad."""

    signal: str
    lags: NDArray[np.int64]
    auto: Array
    cross: Array
    bound: float
    outside: tuple[float, float]
    worst: tuple[float, float]
    rms: float


def residual_analysis(fit: Fit, record: Record, lags: int = 50) -> list[Residuals]:
    """Correlations of the innovations of each encoder that takes part, up to `lags` samples either side."""
    packed = pack(fit.model)
    e = after_settling(record, innovations(packed, fit.noise, record).innovation)
    u = after_settling(record, record.input)
    place = {0: "motor", 1: "arm"}
    return [
        correlations(e[:, c], u, min(lags, len(u) // 4), f"{fit.model.joint}_{place[c]}.position")
        for c in channels(packed, record)
    ]


def tuned_to(fit: Fit, record: Record) -> Fit:
    """A fit with the noise levels of another record; itself where they cannot be tuned."""
    try:
        noise, value = tune_noise(pack(fit.model), fit.noise, [record])
    except (np.linalg.LinAlgError, ValueError):
        return fit
    return replace(fit, noise=noise, log_likelihood=value) if np.isfinite(value) else fit


def model_residuals(model: Model, dataset: DataSet) -> list[Residuals] | None:
    """`residual_analysis` of a model as it is, the noise levels tuned to the data set; None where it
    predicts nothing or the data set is too short to tell."""
    if len(dataset) < FEWEST_SAMPLES:
        return None
    record = max(records_from(dataset), key=len)
    packed = pack(model)
    try:
        noise, value = tune_noise(packed, initial_noise(packed, [record]), [record])
    except (np.linalg.LinAlgError, ValueError):
        return None
    if not np.isfinite(value):
        return None
    nothing = np.zeros(0)
    fit = Fit(model, noise, (), value, np.zeros((0, 0)), nothing, True, 0, "not fitted")
    return residual_analysis(fit, record)


def correlations(e: Array, u: Array, lags: int, signal: str = "") -> Residuals:
    """Auto- and cross-correlation of residuals e (n,) and an input u (n,)."""
    e, u = e - np.mean(e), whitened(u - np.mean(u))
    n = len(e)
    around = np.arange(-lags, lags + 1)
    after = autocorrelation(e, lags)
    auto = np.concatenate([after[:0:-1], after])
    cross = np.concatenate([correlation(e, u, lags)[:0:-1], correlation(u, e, lags)])
    cross /= max(float(np.sqrt((e @ e) * (u @ u))), 1e-300)
    bound = QUANTILE_99 / np.sqrt(n)
    later = around > 0
    outside = tuple(float(np.mean(np.abs(r[later]) > bound)) for r in (auto, cross))
    worst = tuple(float(np.max(np.abs(r[later]), initial=0.0)) for r in (auto, cross))
    return Residuals(signal, around, auto, cross, float(bound), outside, worst, float(np.std(e)))  # pyright: ignore[reportArgumentType]


def whitened(u: Array) -> Array:
    """Residual of an autoregressive model of order ORDER of u (n,)."""
    n, order = len(u), min(ORDER, len(u) // 10)
    r = correlation(u, u, order) / n
    if order < 1 or r[0] <= 0.0:
        return u
    # A ridge, because the power of a smooth input falls by more than the arithmetic resolves.
    r[0] *= 1.0 + 1e-6
    coefficients = np.concatenate([[1.0], -scipy.linalg.solve_toeplitz(r[:-1], r[1:])])
    return np.asarray(scipy.signal.lfilter(coefficients, [1.0], u), dtype=np.float64)


def depends_on_input(one: Residuals) -> bool:
    """Whether past inputs explain what the model does not."""
    return one.outside[1] > 0.1 and one.worst[1] > 0.05


def reading(found: list[Residuals], closed_loop: bool | None) -> list[str]:
    """Say in sentences what the correlations mean."""
    told = []
    for one in found:
        auto, cross = one.outside
        told.append(
            f"{one.signal}: the one-step error is {one.rms:.2g} rad rms; {100 * auto:.0f} % of its "
            "auto-correlations "
            f"lie beyond the bound, the largest is {one.worst[0]:.2f}"
            + ("" if auto > 0.05 else ", as good as white")
            + f"; {100 * cross:.0f} % of the cross-correlations with past inputs, the largest "
            f"{one.worst[1]:.2f}"
            + (": past inputs explain what the model does not" if depends_on_input(one) else "")
            + "."
        )
    if closed_loop:
        told.append(UNDER_FEEDBACK)
    return told

