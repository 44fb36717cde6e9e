"""Where a free simulation has to start so that it comes nearest to what was measured.

Angles and velocities count alike, each by its spread. By angles alone, a heavily damped motor would start
with a speed that it never had: that speed is gone after some milliseconds, but shifts the angle for good and
so makes up for some of what a free integrator drifts away by.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import INITIAL, Packed, predict
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet
from haptic_teleop_sysid.recordings.velocity_series import velocity_series

Array = NDArray[np.float64]
HUGE = 1e6
GAIN = 1e-4
"""Relative gain of the sum of squares that is not worth another response."""
MOST_TRIALS = 30


def without_actuator(model: Model) -> Model:
    """Return the model's mechanics alone, with the acting torque (N·m) as its input."""
    actuator = model.location("actuator")
    return replace(
        model,
        parameters={**model.parameters, "torque_constant": 1.0},
        # What follows the speed as well acts in the equations of motion.
        effects=tuple(
            e for e in model.effects if e.location != actuator or e.entry.kind not in ("input", "skew")
        ),
        fixed=(),
    )


def encoder_angles(dataset: DataSet, span: tuple[int, int]) -> Array:
    """Return (m, 2): measured motor and arm angle over a span, NaN for an arm that was not measured."""
    motor = dataset.motor_position[slice(*span)]
    arm = np.full_like(motor, np.nan) if dataset.arm_position is None else dataset.arm_position[slice(*span)]
    return np.column_stack([motor, arm])


def angle_scales(dataset: DataSet) -> Array:
    """Return (2,): the spread of each measured angle, by which errors are weighted."""
    spreads = [
        float(np.std(y)) if y is not None else 1.0 for y in (dataset.motor_position, dataset.arm_position)
    ]
    return np.maximum(spreads, 1e-9)


def measured_state(dataset: DataSet, start: int) -> Array:
    """Return (4,): the recorded state at a sample, the arm standing in for the motor's where it was not
    measured.
    """
    motor, rate = dataset.motor_position[start], dataset.motor_velocity[start]
    arm = motor if dataset.arm_position is None else dataset.arm_position[start]
    arm_rate = rate if dataset.arm_velocity is None else dataset.arm_velocity[start]
    return np.array([motor, arm, rate, arm_rate])


def estimate_initial_state(
    mechanics: Packed, dataset: DataSet, torque: Array, span: tuple[int, int], velocities: bool = True
) -> Array:
    """Return (4,): the initial state that makes the free response over `span` nearest to the measured angles
    and, with `velocities`, of their filtered rates, in units of each one's spread over the recording.

    Damped Gauss-Newton with the exact sensitivities of the response, from the recorded state; the recorded
    state itself where the response does not stay finite.
    """
    part = slice(*span)
    angles = encoder_angles(dataset, span)
    weights = 1.0 / angle_scales(dataset)
    rates = [
        (channel, 1.0 / max(float(np.std(velocity)), 1e-9))
        for channel, velocity in enumerate((dataset.motor_velocity, dataset.arm_velocity))
        if velocities and velocity is not None
    ]
    used = [0, 2] if mechanics.rigid else [0, 1, 2, 3]
    names = tuple(INITIAL[i] for i in used)
    exogenous = None if dataset.exogenous is None else dataset.exogenous[part]
    t0 = float(dataset.start + dataset.dt * span[0])

    held = last_reading(np.isfinite(angles), mechanics.encoder_shift(dataset.dt)[0])

    def errors_at(state: Array, free: tuple[str, ...] = ()) -> Array:
        """(m, 1 + k): the weighted errors and, of what is free, their derivatives."""
        result = predict(
            mechanics,
            torque[part],
            angles,
            dataset.dt,
            free,
            initial_state=state,
            exogenous=exogenous,
            t0=t0,
        )
        both = np.concatenate([result.innovation[:, :, None], result.d_innovation], axis=2)
        found = [(both * weights[:, None]).reshape(-1, both.shape[2])]
        found += [weight * rate(both[held[:, channel], channel], dataset) for channel, weight in rates]
        return bounded(np.concatenate(found))

    def normal(state: Array) -> tuple[Array, Array]:
        """Errors (m,) and their derivatives (m, k)."""
        both = errors_at(state, names)
        return both[:, 0], both[:, 1:]

    state = measured_state(dataset, span[0])
    error, slope = normal(state)
    cost, damping, fresh = 0.5 * float(error @ error), 1e-9, True
    for _ in range(MOST_TRIALS):
        information, gradient = slope.T @ slope, slope.T @ error
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        lessened = information / np.outer(scale, scale) + damping * np.eye(len(used))
        step = -np.linalg.solve(lessened, gradient / scale) / scale
        expected = -float(gradient @ step) - 0.5 * float(step @ information @ step)
        trial = state.copy()
        trial[used] += step
        # The derivatives hardly change on the way, and cost several responses: they are kept while they keep
        # their promise.
        missed = errors_at(trial)[:, 0]
        gained = cost - 0.5 * float(missed @ missed)
        if gained > 0.0:
            state, error, cost = trial, missed, cost - gained
            damping = max(damping / 30.0, 1e-9)
        kept_promise = gained > 0.5 * expected
        if fresh and (expected < GAIN * cost or 0.0 < gained < GAIN * cost):
            break
        if kept_promise and gained > GAIN * cost:
            fresh = False
        elif fresh and gained <= 0.0:
            damping = max(30.0 * damping, 1e-4)
        else:
            (error, slope), fresh = normal(state), True
    return state


def last_reading(read: NDArray[np.bool_], moved: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (n, 2): the sample of the reading that each sample of both encoders (``read``: whether there is
    one) still has, the first one before there is any.

    ``moved``: the samples by which the model moves readings ahead for a delay, so that its prediction begins
    or ends without them. There it has no error, and the step to the next one would be a speed.
    """
    n = len(read)
    place = np.arange(n)
    found = np.zeros((n, 2), dtype=np.int64)
    for channel in (0, 1):
        source = place + moved[channel]
        there = (source >= 0) & (source < n)
        there[there] = read[source[there], channel]
        if there.any():
            latest = np.maximum.accumulate(np.where(there, place, -1))
            found[:, channel] = np.maximum(latest, np.argmax(there))
    return found


def rate(angle: Array, dataset: DataSet) -> Array:
    """Return (n,) or (n, k): the rate of angles, through the recording's velocity filter where it had one.

    The filter begins at rest: where a recording's own began does not matter then, because errors of angles go
    through it, measured less simulated.
    """
    if dataset.velocity_filter is None:
        return np.gradient(angle, dataset.dt, axis=0)
    return velocity_series(angle, dataset.dt, *dataset.velocity_filter)


def bounded(values: Array) -> Array:
    """Return the values with what is not finite, or beyond HUGE, replaced by HUGE: an unstable response is
    just very wrong.
    """
    if np.max(values, initial=-HUGE) <= HUGE and np.min(values, initial=HUGE) >= -HUGE:
        return values  # as nearly always, at a third of the time
    return np.clip(np.nan_to_num(values, nan=HUGE, posinf=HUGE, neginf=-HUGE), -HUGE, HUGE)
