"""Recordings of a fitted model as they would be with nothing else in them: the same commands, disturbances
and encoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_control.errors import RecordingError
from haptic_teleop_sim.kernel import pack, simulate
from haptic_teleop_sysid.estimation.fit import Fit
from haptic_teleop_sysid.estimation.likelihood import innovation_covariance, innovations
from haptic_teleop_sysid.estimation.noise import NoiseModel
from haptic_teleop_sysid.estimation.records import Record, records_from
from haptic_teleop_sysid.estimation.whole_fit import fit_whole
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.motion import derivative, finite
from haptic_teleop_sysid.recordings.velocity_series import velocity_series

from ..hypotheses.explanation import Explanation
from .whiteness import colour, heaviness

#: Share of its gain that a finding may reach where it is not, and steps of the fits that show it.
AS_WELL = 0.3
_STEPS = 15
#: Factor over what any of so many simulated recordings has, from which large sums of innovations are not the
#: encoders': of one flexible joint whose arm rests for a second they have from 0.4 to 6.9.
_BEYOND_ROUNDING, _SIMULATED = 1.5, 12
#: Factor that makes nothing of the fitted random torques.
_NEXT_TO_NOTHING = 1e-6


def expected_colour(fit: Fit, records: Sequence[Record]) -> float:
    """The `colour` that the innovations of a fit would have if nothing else were in the recordings: that of
    simulated ones. The steps of an encoder that hardly moves colour the innovations of a true model."""
    return colour(fit, null_records(fit, records))


def null_records(
    fit: Fit, records: Sequence[Record], seed: int = 0, levels: Sequence[NoiseModel] = ()
) -> list[Record]:
    """A recording of the fitted model for each, with disturbances as large as there (``levels``, where they
    are known); the same ones whenever it is asked with one seed."""
    generator = np.random.default_rng(seed)
    levels = levels or [disturbed_as(fit, r) for r in records]
    return [null_record(fit, noise, r, generator) for noise, r in zip(levels, records, strict=True)]


def with_noisy_input(fit: Fit, records: Sequence[Record]) -> list[Record]:
    """A recording of the fitted model for each, in which nothing acts that is not in it, and whose input is
    recorded with as much noise as there."""
    generator = np.random.default_rng(0)
    nothing = fit.noise.scaled(motor_torque=_NEXT_TO_NOTHING, arm_torque=_NEXT_TO_NOTHING)
    made = [null_record(fit, nothing, r, generator) for r in records]
    return [replace(m, input=m.input + m.input_noise * generator.standard_normal(len(m))) for m in made]


def rounding_shows(found: Explanation, before: Fit, records: Sequence[Record]) -> bool:
    """Whether what was found explains simulated recordings of the model without it, ``before``, as it does
    the real ones (AS_WELL): it then stands for the encoders' steps. Each of the two models begins with the
    noise levels of the other one, too: levels that only one of them finds are no merit of the effect."""
    made = null_records(before, records)
    begun = [_fitted_again(fit, fit.noise, made) for fit in (before, found.fit)]
    pairs = zip((before, found.fit), begun, reversed(begun), strict=True)
    alone, beside = (
        max(own.log_likelihood, _fitted_again(fit, other.noise, made).log_likelihood)
        for fit, own, other in pairs
    )
    return beside - alone > AS_WELL * found.gain


def _fitted_again(fit: Fit, noise: NoiseModel, records: Sequence[Record]) -> Fit:
    """A fit of the same model to other records, from noise levels."""
    return fit_whole(fit.model, noise, records, free=fit.free, iterations=_STEPS)


def disturbed_as(fit: Fit, record: Record) -> NoiseModel:
    """The fitted noise model with levels as large as those of a recording.

    The likelihood knows levels only relative to each other and to the motor encoder's steps; how large they
    are shows in how much the observer had to correct, here against a recording made with the fitted ones.
    """
    made = null_record(fit, fit.noise, record, np.random.default_rng(0))
    rounding = np.square(record.resolution) / 12.0
    had, has = (_power(fit, r) - rounding for r in (record, made))
    factor = np.sqrt(np.clip(had / np.maximum(has, 1e-30), 1e-6, 1e4))
    motor, arm = float(factor[0]), float(factor[1])
    return fit.noise.scaled(motor_torque=motor, arm_torque=arm, arm_angle=arm)


def _power(fit: Fit, record: Record) -> NDArray[np.float64]:
    """Mean squares of the innovations, (2,); 0 for an encoder that is not there."""
    packed = pack(fit.model)
    found = np.zeros(2)
    own = np.diag(innovation_covariance(packed, record, innovations(packed, fit.noise, record).innovation))
    found[: len(own)] = own
    return found


def null_record(fit: Fit, noise: NoiseModel, record: Record, generator: np.random.Generator) -> Record:
    """A recording of the fitted model under the same command, disturbed as the noise model says."""
    packed, n = pack(fit.model), len(record)
    level = np.array([noise.motor_torque, 0.0 if packed.rigid else noise.arm_torque])
    decay = np.array(noise.decay(record.dt))
    drawn = generator.standard_normal((n, 2)) * np.sqrt(1.0 - decay**2)
    drawn[0] = generator.standard_normal(2)
    coloured = [scipy.signal.lfilter([1.0], [1.0, -d], drawn[:, c]) for c, d in enumerate(decay)]
    disturbance = level * np.column_stack(coloured)
    path = simulate(
        packed,
        record.input,
        record.dt,
        record.initial_state(),
        motor_torque=disturbance[:, 0],
        external_torque=disturbance[:, 1],
        exogenous=record.exogenous,
        t0=record.start,
    )
    steps = np.maximum(np.array(record.resolution), 1e-12)
    # What the readings scatter by beyond their steps.
    more = np.sqrt(np.maximum(np.array([noise.motor_angle, noise.arm_angle]) ** 2 - steps**2 / 12.0, 0.0))
    read = np.column_stack([path.motor_position, path.arm_position])
    read += more * generator.standard_normal((n, 2))
    with np.errstate(over="ignore"):  # what runs away is told by who asked
        measured = np.where(np.isfinite(record.measured), np.rint(read / steps) * steps, np.nan)
    # Here the first reading is where it began.
    return replace(record, name=f"{record.name}, nothing hidden", measured=measured, offsets=(0.0, 0.0))


def levels_of(fit: Fit, dataset: DataSet) -> list[NoiseModel]:
    """The noise model of every piece of a data set (`records_from`), with levels as large as there."""
    return [disturbed_as(fit, piece) for piece in records_from(dataset, commanded=True)]


def null_dataset(
    fit: Fit, dataset: DataSet, levels: Sequence[NoiseModel], generator: np.random.Generator
) -> DataSet:
    """A data set of the fitted model under the same command, piece by piece disturbed as its ``levels`` say.

    A measured current follows its command but for what the recorded one differed by, in random order: the
    noise of its sense without what the actuator may have had.  Raises RecordingError where the model runs
    away.
    """
    own = {n: v.copy() for n, v in _motion(dataset).items()}
    valid = np.zeros(len(dataset), dtype=np.bool_)
    for piece, noise in zip(records_from(dataset, commanded=True), levels, strict=True):
        first = round((piece.start - dataset.start) / dataset.dt)
        here = slice(first, first + len(piece))
        made = null_record(fit, noise, piece, generator)
        if not np.all(np.isfinite(made.measured) == np.isfinite(piece.measured)):
            raise RecordingError(
                f"{dataset.name}: the re-estimated structure runs away when it is simulated under the "
                "recorded command, so no recording with nothing hidden can be made: leave --nulls out."
            )
        valid[here] = dataset.valid[here] if len(dataset.valid) else True
        for channel, side in enumerate(("motor", "arm")):
            if f"{side}_position" in own:
                angle = finite(made.measured[:, channel], None)
                own[f"{side}_position"][here] = angle
                own[f"{side}_velocity"][here] = _rate(dataset, angle)
    sensed = dataset.input
    if dataset.commanded_input is not None and dataset.input_source == "measured effort":
        sensed = dataset.commanded_input + generator.permutation(dataset.input - dataset.commanded_input)
    return replace(dataset, **own, input=sensed, valid=valid, problems=(), slips=())


def _motion(dataset: DataSet) -> dict[str, NDArray[np.float64]]:
    """Angles and rates (n,) of a data set by the names of its fields, without those it does not have."""
    names = ("motor_position", "motor_velocity", "arm_position", "arm_velocity")
    return {n: v for n in names if (v := getattr(dataset, n)) is not None}


def _rate(dataset: DataSet, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """The velocity (n,) that the recording's filter makes of an angle (n,), or that of a cubic."""
    if dataset.velocity_filter is None:
        return derivative(angle, 11, 1, dataset.dt)
    return velocity_series(angle, dataset.dt, *dataset.velocity_filter)


def heavy_tailed(fits: Sequence[tuple[Fit, Sequence[Record]]]) -> int | None:
    """The encoder (0 motor, 1 arm) of which sums of innovations are far more often large than normal ones
    would be (`whiteness.heaviness`), on every recording of all (fit, recordings), because something acts now
    and then; the one where they exceed that most, None for none. A coarse encoder errs by the same for as
    long as its axis is slow: what any of _SIMULATED recordings of the same fit has, in which nothing acts, is
    its own."""
    found = {key: ratio for key, ratio in heaviness(fits).items() if ratio > 1.0}
    if not found:
        return None
    levels = [[disturbed_as(fit, r) for r in records] for fit, records in fits]
    pairs = [(*pair, of_it) for pair, of_it in zip(fits, levels, strict=True)]
    made = [
        heaviness([(fit, null_records(fit, records, seed, of_it)) for fit, records, of_it in pairs])
        for seed in range(_SIMULATED)
    ]
    most = {key: max(ratios.get(key, 0.0) for ratios in made) for key in found}
    beyond = {key: ratio for key, ratio in found.items() if ratio > _BEYOND_ROUNDING * most[key]}
    return max(beyond, key=lambda key: beyond[key])[0] if beyond else None
