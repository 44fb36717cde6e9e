"""Two encoders of a flexible joint whose zeros differ.

Absolute encoders on both sides of a joint seldom agree to the milliradian of which a stiff transmission makes
a large torque. Then the spring of the model pulls at motor and arm all the time, by torques that nothing
balances. It shows in the motor's equation of motion,

    k (q - q_a) - K u  =  -(J a + b v + F sign v) + c,

which a weight at the arm is not in: c is k times the difference of the zeros, or a constant torque at the
motor. Only the latter is in the equation of the whole joint, which has no spring.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from haptic_teleop_sim.model import Model
from haptic_teleop_sysid.recordings.dataset import DataSet

from .scales import bridged

FloatArray = NDArray[np.float64]

#: Cut-off of the filter, Hz, and as a share of the sampling rate; velocity, relative to the largest, within
#: which its sign is smoothed.
_BAND, _SHARE, _SMOOTH = 8.0, 0.1, 0.02
#: The spring's constant torque, of the rms input's, from which zeros differ, and the most of it that the
#: whole joint may show. By hand: at a robot's axis it is 2.4 and 1.7, of which 0.28 and 0.09; of 2800
#: recordings of the benchmark and ten of other real joints none passes, of 268 of physics outside the table
#: one.
LEAST, BALANCED = 0.3, 0.35
#: Parts of a recording, and the most by which the constant may differ between them, of its mean: an encoder
#: that slips or loses counts has no zero. By hand, on ten such ones in four draws of other physics.
PARTS, STEADY = 4, 0.5
#: Most that the motor's equation may leave, of the input's variance: one less this share.
_EXPLAINS = 0.5


def with_one_zero(data: DataSet, model: Model) -> DataSet:
    """The data set with the arm's angle from where the spring of ``model`` is at rest, and a problem that
    says so, where the two encoders have different zeros; else as it is."""
    if model.rigid or data.arm_position is None:
        return data
    shift = difference_of_zeros(data, model)
    if shift == 0.0:
        return data
    torque = abs(model.parameters["stiffness"] * shift)
    angle, how = f"{1e3 * abs(shift):.3g} m{data.position_unit}", "added to" if shift > 0.0 else "taken from"
    problem = (
        f"the encoders of motor and arm have different zeros: {angle} are {how} the arm's angle, as the "
        f"spring of the model would pull with {torque:.3g} all the time, which no torque balances"
    )
    return replace(data, arm_position=data.arm_position + shift, problems=(*data.problems, problem))


def difference_of_zeros(data: DataSet, model: Model) -> float:
    """What is to be added to the arm's angle, rad (m); 0 where the zeros do not differ, or nobody can
    tell."""
    assert data.arm_position is not None
    cut = min(_BAND, _SHARE / data.dt)
    ends = round(1.0 / (cut * data.dt))
    # A command carries no offset of a current sense.
    input_ = data.input if data.commanded_input is None else data.commanded_input
    drive = model.parameters["torque_constant"] * input_
    both = data.motor_position, data.arm_position
    angles = [np.where(data.valid, a, np.nan) if len(data.valid) else a for a in both]
    if not all(np.isfinite(a).sum() > 4 * ends for a in angles) or not np.all(np.isfinite(drive)):
        return 0.0
    low_pass = scipy.signal.butter(2, 2.0 * cut * data.dt, output="sos")
    motor, arm, drive = (scipy.signal.sosfiltfilt(low_pass, bridged(a)) for a in (*angles, drive))
    inside = slice(ends, len(drive) - ends)
    own, of_arm = _along(motor, data.dt), _along(arm, data.dt)
    spring, power = model.parameters["stiffness"] * (motor - arm), float(np.var(drive[inside]))
    # An encoder of another scale reads an angle away from zero elsewhere, too.
    constants, left = _constants([*own, motor], spring - drive, inside)
    whole = float(np.mean(_constants([*own, *of_arm, motor], drive, inside)[0]))
    mean = float(np.mean(constants))
    if left > (1.0 - _EXPLAINS) * power or np.ptp(constants) > STEADY * abs(mean):
        return 0.0
    if abs(mean) < LEAST * np.sqrt(power) or abs(whole) > BALANCED * abs(mean):
        return 0.0
    return float(np.mean(_constants([*own], spring - drive, inside)[0])) / model.parameters["stiffness"]


def _along(angle: FloatArray, dt: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Acceleration, velocity and its sign (n,) of an angle."""
    velocity = np.gradient(angle, dt)
    sign = np.tanh(velocity / max(_SMOOTH * float(np.max(np.abs(velocity))), 1e-300))
    return np.gradient(velocity, dt), velocity, sign


def _constants(columns: list[FloatArray], torque: FloatArray, inside: slice) -> tuple[FloatArray, float]:
    """The constant of each of PARTS beside columns (n,) that explain a torque best, and the variance of what
    they leave."""
    part = np.arange(len(torque[inside])) * PARTS // len(torque[inside])
    constants = (part[:, None] == np.arange(PARTS)).astype(np.float64)
    design = np.column_stack([*(c[inside] for c in columns), constants])
    scale = np.maximum(np.sqrt(np.mean(design**2, axis=0)), 1e-300)
    found = np.linalg.lstsq(design / scale, torque[inside], rcond=1e-9)[0]
    left = float(np.var(torque[inside] - design / scale @ found))
    return np.asarray(found[-PARTS:] / scale[-PARTS:], dtype=np.float64), left
