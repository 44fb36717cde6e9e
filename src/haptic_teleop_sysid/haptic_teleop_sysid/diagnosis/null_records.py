"""Recordings of a fitted model as they would be with nothing else in them: the same commands, disturbances
and encoders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import pack, simulate
from haptic_teleop_sysid.estimation.gauss_newton import Fit
from haptic_teleop_sysid.estimation.likelihood import channels, innovations, settled
from haptic_teleop_sysid.estimation.noise import NoiseModel, observer
from haptic_teleop_sysid.estimation.records import Record
from haptic_teleop_sysid.estimation.whole_fit import fit_whole

from .explanation import Explanation
from .whiteness import colour

#: Share of its gain that a finding may reach where it is not, and steps of the fits that show it.
AS_WELL = 0.3
_STEPS = 15


def expected_colour(fit: Fit, records: Sequence[Record]) -> float:
    """The `colour` that the innovations of a fit would have if nothing else were in the recordings: that of
    simulated ones. The steps of an encoder that hardly moves colour the innovations of a true model."""
    generator = np.random.default_rng(0)
    return colour(fit, [null_record(fit, disturbed_as(fit, r), r, generator) for r in records])


def rounding_shows(found: Explanation, before: Fit, records: Sequence[Record]) -> bool:
    """Whether what was found explains simulated recordings of the model without it, ``before``, as it does
    the real ones (AS_WELL): it then stands for the encoders' steps."""
    generator = np.random.default_rng(0)
    made = [null_record(before, disturbed_as(before, r), r, generator) for r in records]
    alone = fit_whole(before.model, before.noise, made, free=before.free, iterations=_STEPS)
    beside = fit_whole(found.fit.model, found.fit.noise, made, free=found.fit.free, iterations=_STEPS)
    return beside.log_likelihood - alone.log_likelihood > AS_WELL * found.gain


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
    errors = settled(record, innovations(pack(fit.model), fit.noise, record).innovation)
    return np.mean(np.square(errors), axis=0)


def null_record(fit: Fit, noise: NoiseModel, record: Record, generator: np.random.Generator) -> Record:
    """A recording of the fitted model under the same command, disturbed as the noise model says."""
    packed, n = pack(fit.model), len(record)
    path = simulate(
        fit.model,
        record.input,
        record.dt,
        record.initial_state(),
        exogenous=record.exogenous,
        t0=record.start,
    )
    # The disturbances' answer is added: exact for a linear structure, and small.
    transition, _, _ = observer(packed, noise, record.dt, channels(packed, record))
    decay = np.array(noise.decay(record.dt))
    level = np.array([noise.motor_torque, noise.arm_torque])
    drawn = generator.standard_normal((n, 2)) * level * np.sqrt(1.0 - decay**2)
    state, moved = np.zeros(6), np.empty((n, 2))
    state[4:] = level * generator.standard_normal(2)
    for k in range(n):
        moved[k] = state[:2]
        state = transition @ state
        state[4:] += drawn[k]
    if packed.rigid:
        moved[:, 1] = moved[:, 0]
    steps = np.maximum(np.array(record.resolution), 1e-12)
    # What the readings scatter by beyond their steps.
    more = np.sqrt(np.maximum(np.array([noise.motor_angle, noise.arm_angle]) ** 2 - steps**2 / 12.0, 0.0))
    read = np.column_stack([path.motor_position, path.arm_position]) + moved
    read += more * generator.standard_normal((n, 2))
    measured = np.where(np.isfinite(record.measured), np.rint(read / steps) * steps, np.nan)
    return replace(record, name=f"{record.name}, nothing hidden", measured=measured)
