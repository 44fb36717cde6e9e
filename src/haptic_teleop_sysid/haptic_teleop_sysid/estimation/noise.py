"""The noise model of the predictor: disturbance torques on motor and arm, encoder noise, observer gain.

A recording differs from its model by torques nobody recorded (friction that varies, the cable, the other
stage) and by the encoders' steps.  The first are modelled as first-order coloured torques at motor and arm,
the second as white noise; the stationary Kalman gain of the linearised joint turns both into an observer
whose innovations are white when the model is right.  This is the prediction-error form (Ljung, System
Identification, 1999, ch. 7): unlike a plain simulation it stays consistent when the input was computed from
the output (closed loop), and does not let a slow disturbance pass for physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_sim.kernel import Packed

from .riccati import exponential, stationary_filter

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseModel:
    """Levels of the noise.

    motor_torque, arm_torque: rms of the disturbance torques, N·m. motor_time, arm_time: their correlation
    times, s. motor_angle, arm_angle: rms of the encoders' noise, rad.  All greater than zero.
    ``reference``: the structure (as ``Packed.linear``) whose linearisation gives the observer gain, so that
    several models are judged by one and the same observer (their encoders' delays and scales apart); None:
    each model's own.
    """

    motor_torque: float
    arm_torque: float
    motor_angle: float
    arm_angle: float
    motor_time: float = 0.1
    arm_time: float = 0.1
    reference: tuple[float, ...] | None = None

    def scaled(self, **factors: float) -> NoiseModel:
        """A copy with some levels multiplied."""
        return replace(self, **{name: getattr(self, name) * factor for name, factor in factors.items()})

    def decay(self, dt: float) -> tuple[float, float]:
        """Factor per sample of the two disturbance torques."""
        return float(np.exp(-dt / self.motor_time)), float(np.exp(-dt / self.arm_time))


def linearised(packed: Packed, reference: tuple[float, ...] | None = None) -> tuple[FloatArray, FloatArray]:
    """(6, 6) continuous system matrix over [q_motor, q_arm, v_motor, v_arm, d_motor, d_arm] of the structure
    and the model's springs against the ground, and the location of the angles (2, 6); ``reference`` replaces
    the model's numbers."""
    return _linearised(packed.linear if reference is None else reference, packed.rigid)


def _linearised(base: tuple[float, ...], rigid: bool) -> tuple[FloatArray, FloatArray]:
    ks, jm, bm, ja, ba, ground_motor, ground_arm = base
    a = np.zeros((6, 6))
    a[0, 2] = 1.0
    if not rigid:
        a[1, 3] = 1.0
        a[2, :4] = [-(ks + ground_motor) / jm, ks / jm, -bm / jm, 0.0]
        a[3, :4] = [ks / ja, -(ks + ground_arm) / ja, 0.0, -ba / ja]
        a[3, 5] = 1.0 / ja
    else:
        a[2, 0], a[2, 2] = -ground_motor / jm, -bm / jm
    a[2, 4] = 1.0 / jm
    c = np.zeros((2, 6))
    c[0, 0] = c[1, 1] = 1.0
    return a, c


def observer(
    packed: Packed, noise: NoiseModel, dt: float, measured: Sequence[int] | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The stationary observer of the structure linearised at speed: transition (6, 6) over one sample of
    [q_motor, q_arm, v_motor, v_arm, d_motor, d_arm], whose columns 4 and 5 are also the answer to a torque
    held over the sample, gain (6, 2), and what the encoders show of the state (2, 6): `observer_gain`."""
    base = noise.reference if noise.reference is not None else packed.linear
    gain = observer_gain(packed, noise, dt, measured)
    lead = tuple(packed.encoder_shift(dt)[1].tolist())
    shown = _shown(base, bool(packed.rigid), lead, packed.encoder_slope)
    return _transition(base, bool(packed.rigid), noise, dt), gain[[0, 1, 2, 3, -2, -1]], shown


def _shown(
    base: tuple[float, ...], rigid: bool, lead: tuple[float, ...], slope: tuple[float, float]
) -> FloatArray:
    """What encoders show (2, 6) of the state when they are ``lead`` (2,) seconds ahead of it and rise by
    ``slope`` (2,) with the angle: late by a part of a sample, a reading is of the speed as well, and its
    observer corrects otherwise; so it does by less where the reading is a multiple of the angle."""
    a, c = _linearised(base, rigid)
    for channel in (0, 1):
        if lead[channel] != 0.0:
            c[channel] = exponential(a * lead[channel])[channel]
        c[channel] *= slope[channel]
    return c


def _transition(base: tuple[float, ...], rigid: bool, noise: NoiseModel, dt: float) -> FloatArray:
    a, _ = _linearised(base, rigid)
    transition = np.zeros((6, 6))
    transition[:4, :] = exponential(a * dt)[:4, :]
    transition[4, 4], transition[5, 5] = noise.decay(dt)
    return transition


def observer_gain(
    packed: Packed,
    noise: NoiseModel,
    dt: float,
    measured: Sequence[int] | None = None,
    lead: FloatArray | None = None,
) -> FloatArray:
    """Stationary Kalman gain (packed.states, 2) of the structure linearised at speed; own states of effects
    get none. ``measured`` says which encoders take part (0 motor, 1 arm; both by default, the motor's alone
    for a rigid body): an arm that nobody reads has to be inferred from the motor, with another gain.
    ``lead`` (2,): how far the encoders are ahead of the state, s (the model's own by default).

    Raises numpy.linalg.LinAlgError when the Riccati equation has no solution (unobservable or overflowing
    levels).
    """
    rigid = bool(packed.rigid)
    channels = tuple([0] if rigid else [0, 1]) if measured is None else tuple(measured)
    base = noise.reference if noise.reference is not None else packed.linear
    ahead = packed.encoder_shift(dt)[1] if lead is None else lead
    own, slope = replace(noise, reference=None), packed.encoder_slope
    gain = _structure_gain(base, rigid, own, dt, channels, tuple(ahead.tolist()), slope)
    full = np.zeros((packed.states, 2))
    full[:4], full[-2:] = gain[:4], gain[4:]
    return full


@lru_cache(maxsize=64)
def _structure_gain(
    base: tuple[float, ...],
    rigid: bool,
    noise: NoiseModel,
    dt: float,
    channels: tuple[int, ...],
    lead: tuple[float, ...],
    slope: tuple[float, float],
) -> FloatArray:
    """The gain (6, 2) of the structure alone: screening asks for one and the same hundreds of times."""
    c = _shown(base, rigid, lead, slope)
    transition, decay = _transition(base, rigid, noise, dt), noise.decay(dt)
    # Scaled to unit encoder noise: the equation mixes 1e-10 rad^2 with N·m^2 otherwise.
    scale = noise.motor_angle**2
    q, r = np.zeros((6, 6)), np.eye(2)
    q[4, 4] = noise.motor_torque**2 * (1.0 - decay[0] ** 2) / scale
    q[5, 5] = noise.arm_torque**2 * (1.0 - decay[1] ** 2) / scale
    r[1, 1] = noise.arm_angle**2 / scale
    keep, used = slice(0, 6, 2 if rigid else 1), slice(channels[0], channels[-1] + 1)
    gain = np.zeros((6, 2))
    gain[keep, used] = stationary_filter(
        transition[keep, keep], c[used, keep], q[keep, keep], r[used, used]
    )[1]
    return gain
