"""Where a free simulation has to start so that it comes nearest to what was measured.

Angles and velocities count alike, each by its spread. By angles alone, a heavily damped motor would start
with a speed that it never had: that speed is gone after some milliseconds, but shifts the angle for good and
so makes up for some of what a free integrator drifts away by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed, nearest_starts
from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet

Array = NDArray[np.float64]


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


def encoder_angles(dataset: DataSet) -> Array:
    """Return (n, 2): measured motor and arm angle, NaN for an arm that was not measured."""
    motor, arm = dataset.motor_position, dataset.arm_position
    return np.column_stack([motor, np.full_like(motor, np.nan) if arm is None else arm])


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


def estimate_initial_states(
    mechanics: Packed,
    dataset: DataSet,
    torque: Array,
    spans: Sequence[tuple[int, int]],
    velocities: bool = True,
) -> Array:
    """Return (windows, 4): the initial states that make the free responses over `spans` nearest to the
    measured angles and, with `velocities`, to their filtered rates, in units of each one's spread over the
    recording.

    `torque` (n,): what acts on the `mechanics`, N·m. The recorded state itself where the response does not
    stay finite.
    """
    rates = (dataset.motor_velocity, dataset.arm_velocity) if velocities else (None, None)
    rate_weights = [0.0 if rate is None else 1.0 / max(float(np.std(rate)), 1e-9) for rate in rates]
    return nearest_starts(
        mechanics,
        torque,
        encoder_angles(dataset),
        dataset.dt,
        spans,
        np.array([measured_state(dataset, start) for start, _ in spans]),
        weights=1.0 / angle_scales(dataset),
        rate_weights=np.array(rate_weights),
        velocity_filter=dataset.velocity_filter,
        exogenous=dataset.exogenous,
        t0=float(dataset.start),
    )
