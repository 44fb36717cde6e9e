"""Whether a recording can teach a model anything: what moves, at which frequencies, and which parameters
show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.kernel import pack
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.estimation.contradictions import contradictions
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.graduated import distrustful_noise, nearest_start
from haptic_teleop_sysid.estimation.prediction_fit import normal_equations
from haptic_teleop_sysid.estimation.records import Record, record_from, records_from, thinned_to
from haptic_teleop_sysid.estimation.tuning import tune_noise
from haptic_teleop_sysid.estimation.uncertainty import Uncertainty, uncertainty
from haptic_teleop_sysid.estimation.whole_fit import fit_from_scratch
from haptic_teleop_sysid.recordings.dataset import DataSet

Array = NDArray[np.float64]
FEWEST_SAMPLES = 100
"""Samples below which parameters and a noise model cannot both be had from a recording."""
FEWEST_STEPS = 20.0
"""Encoder steps that a motion must span to count as one."""
NOT_FITTED = "not fitted"
"""Message of a fit that is none: the model's own values (`at_values`)."""


def refuse_idle(dataset: DataSet) -> None:
    """Raise RecordingError when no parameter can be identified: too short, nothing put in, or nothing
    moved."""
    name, n = dataset.name, len(dataset)
    usable = int(np.sum(dataset.valid)) if len(dataset.valid) else n
    if usable < FEWEST_SAMPLES:
        raise RecordingError(
            f"{name} has {usable} usable samples, and at least {FEWEST_SAMPLES} are needed to identify "
            "anything: record longer, or use more of it."
        )
    source = dataset.commanded_input if dataset.commanded_input is not None else dataset.input
    if np.ptp(source) <= 1e-12 * max(float(np.max(np.abs(source))), 1e-12):
        raise RecordingError(
            f"{name}: not identifiable, because the input of {dataset.joint} never changes (it is "
            f"{float(source[0]):.4g} {dataset.input_unit} throughout): record a signal that moves the joint."
        )
    steps = record_from(dataset).resolution[0]
    if float(np.ptp(dataset.motor_position)) < FEWEST_STEPS * steps:
        raise RecordingError(
            f"{name}: not identifiable, because {dataset.joint} moved by "
            f"{np.ptp(dataset.motor_position):.2g} rad, "
            f"fewer than {FEWEST_STEPS:g} encoder steps: enable the joint, or excite it more."
        )


@dataclass(frozen=True)
class Excitation:
    """frequency (k,) Hz; input_spectrum, response_spectrum (k,): power densities of input and motor speed,
    unit²/Hz. band: (low, high) Hz with 95 % of the input's power. expected: standard errors of the
    parameters, and condition of the scaled information; fit: the quick fit that they are those of;
    contradictions: of that fit, by effect in words."""

    frequency: Array
    input_spectrum: Array
    response_spectrum: Array
    band: tuple[float, float]
    expected: Uncertainty
    fit: Fit
    contradictions: Mapping[str, str] = field(default_factory=dict)


def excitation(model: Model, datasets: Sequence[DataSet], starts: Sequence[Model] = ()) -> Excitation:
    """Judge recordings with a model; ``starts``: the same model with other values to fit it from.

    What a recording can say of parameters depends on what they leave unexplained: with a model's present
    values that is mostly how wrong these are. So it is asked of a quick fit to the thinned recordings."""
    records = [piece for d in datasets for piece in records_from(d)]
    longest = max(datasets, key=len)
    length = min(len(longest), max(256, round(8.0 / longest.dt)))
    frequency, power = scipy.signal.welch(longest.input, 1.0 / longest.dt, nperseg=length)
    _, response = scipy.signal.welch(longest.motor_velocity, 1.0 / longest.dt, nperseg=length)
    share = np.cumsum(power) / max(float(np.sum(power)), 1e-300)
    low, high = (
        float(frequency[min(int(np.searchsorted(share, s)), len(frequency) - 1)]) for s in (0.025, 0.975)
    )
    thinned = thinned_to(records)
    fit = fit_from_scratch(nearest_start([model, *starts], thinned), thinned)
    if not np.isfinite(fit.log_likelihood):
        fit = at_values(model, records)
    expected = uncertainty(fit, thinned)
    odd = contradictions(fit.model, expected)
    return Excitation(frequency, power, response, (low, high), expected, fit, odd)


def at_values(model: Model, records: Sequence[Record]) -> Fit:
    """A model's own values as if they had been fitted: noise levels tuned, information evaluated."""
    noise, _ = tune_noise(pack(model), distrustful_noise(model, records, 0.003), records)
    free = model.free_parameters()
    information, gradient, value = normal_equations(model, noise, records, free)
    return Fit(model, noise, free, value, information, gradient, True, 0, NOT_FITTED)
