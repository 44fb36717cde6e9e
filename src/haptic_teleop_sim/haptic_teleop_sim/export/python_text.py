"""The fixed parts of a model as a Python file; between them stands what the model says."""

from __future__ import annotations

from collections.abc import Sequence


def indented(lines: Sequence[str], spaces: int) -> str:
    """Lines (each may hold several) behind so many spaces; empty ones stay empty."""
    return "\n".join(
        " " * spaces + line if line else "" for block in lines for line in block.rstrip("\n").split("\n")
    )


SIGNATURE = '''"""Model of {title}, exported by haptic-teleop.

Effects: {effects}.
It needs NumPy and nothing else.
"""

import numpy as np


def simulate(input_, dt, initial_state=(0.0, 0.0, 0.0, 0.0), external_torque=None,
             other_arm_acceleration=None, t0=0.0):
    """Response to an input that is held over each sample: a dict of arrays (n,), SI units.

    input_ (n,): {unit}; dt: s; initial_state: motor and arm angle, rad, motor and arm velocity, rad/s;
    external_torque (n,): of the environment on the arm (on the body, where it is rigid), N*m;
    other_arm_acceleration (n,), rad/s^2: for inertial coupling; t0: s, time of the first sample.
    Keys: time, motor_position, motor_velocity, arm_position, arm_velocity as the encoders report them, each
    before the torque of its sample acts, torque: what acts on the motor over the sample, N*m, and states
    (n, 4): the true angles and velocities.
    """
'''

HELPERS = '''def tanh(x):
    a = abs(x)
    if a > 20.0:
        return 1.0 if x > 0.0 else -1.0
    e = float(np.exp(-2.0 * a))
    return (1.0 - e) / (1.0 + e) if x >= 0.0 else -(1.0 - e) / (1.0 + e)

def sech(x):
    e = float(np.exp(-abs(x)))
    return 2.0 * e / (1.0 + e * e)

def direction_of(moved, v, memory, displacement):
    # Exact solution of d s = (d q - |d q| s) / displacement over a motion one way.
    side = 1.0 if moved > 0.0 or (moved == 0.0 and v >= 0.0) else -1.0
    ways = abs(moved) / displacement
    return side + (memory - side) * float(np.exp(-ways)) if ways < 40.0 else side
'''

LATE = '''def stamped_late(torque, samples, dt):
    # What the record shows later acted now; the change within a sample keeps its moment.
    steps = np.arange(len(torque)) + samples
    ends = np.append(torque, torque[-1:])
    at = np.clip(np.floor(steps).astype(np.int64), 0, len(torque) - 1)
    part = np.clip(steps - at, 0.0, 1.0)
    moment = 0.5 * dt * dt * (ends[at] - ends[at + 1]) * part * (1.0 - part)
    return np.interp(steps, np.arange(len(torque)), torque), moment

def seen_late(time, q, v, delay):
    # Cubic Hermite interpolation of angle and velocity at the time that is seen; steady before and after.
    if delay == 0.0 or len(time) < 2:
        return q, v
    when = np.clip(time - delay, time[0], time[-1])
    beyond = time - delay - when
    i = np.clip(np.searchsorted(time, when, side="right") - 1, 0, len(time) - 2)
    h = time[i + 1] - time[i]
    s = (when - time[i]) / h
    a, b, va, vb = q[i], q[i + 1], v[i] * h, v[i + 1] * h
    c2, c3 = 3.0 * (b - a) - 2.0 * va - vb, 2.0 * (a - b) + va + vb
    rate = (va + s * (2.0 * c2 + 3.0 * s * c3)) / h
    return a + s * (va + s * (c2 + s * c3)) + rate * beyond, rate
'''

LOOP = '''def rates(qm, qa, vm, va, z, moved_motor, moved_arm, t, torque_motor, torque_arm, other, dz):
    d, dv, moved_joint = qm - qa, vm - va, moved_motor - moved_arm
    motor_torque, arm_torque, joint_torque = torque_motor, torque_arm, stiffness * d
    driving = torque_motor{driving}
    motor_friction, arm_friction = -motor_damping * vm, -arm_damping * va
    motor_factor, arm_factor, motor_mass, arm_mass = 1.0, 1.0, motor_inertia, arm_inertia
{rates}
    return {result}

def zeros_or(values):
    return np.zeros(n) if values is None else np.asarray(values, dtype=float)

torque = torque_constant * np.array(input_, dtype=float)
n, moment = len(torque), np.zeros(len(torque))
outer, others = zeros_or(external_torque), zeros_or(other_arm_acceleration)
y, z, dz = [float(value) for value in initial_state], [0.0] * {states}, [0.0] * {states}
{start}
{outer}
least = substeps = {steps}
h, states = dt / substeps, np.empty((n, 4))
for i in range(n):
    states[i] = y
{here}    for sub in range(substeps):
        t, start, began, rate_sum = t0 + i * dt + sub * h, list(y), list(z), [0.0] * len(z)
        slopes, speeds, now, middle = [0.0, 0.0], [0.0, 0.0], y, list(z)
        for k in range(4):
            weight = 1.0 if k in (0, 3) else 2.0
            ahead = h if k == 2 else 0.5 * h
            when = t if k == 0 else (t + h if k == 3 else t + 0.5 * h)
            qm, qa, vm, va = now
            am, aa = rates(qm, qa, vm, va, middle, qm - start[0], qa - start[1], when, float(torque[i]),
                           float(outer[i]), float(others[i]), dz)
            wa = {arm_rate}
            speeds = [speeds[0] + weight * vm, speeds[1] + weight * wa]
            slopes = [slopes[0] + weight * am, slopes[1] + weight * aa]
            rate_sum = [total + weight * rate for total, rate in zip(rate_sum, dz)]
            middle = [value + ahead * rate for value, rate in zip(began, dz)]
            now = [start[0] + ahead * vm, start[1] + ahead * wa, start[2] + ahead * am,
                   start[3] + ahead * aa]
        moved_motor, moved_arm = h / 6.0 * speeds[0], h / 6.0 * speeds[1]
        moved_joint = moved_motor - moved_arm
        y = [start[0] + moved_motor, start[1] + moved_arm, start[2] + h / 6.0 * slopes[0],
             start[3] + h / 6.0 * slopes[1]]
        z = [value + h / 6.0 * total for value, total in zip(began, rate_sum)]
        end_motor, end_arm, end_joint = y[2], y[3], y[2] - y[3]
{memory}
    # How the torque was spread over the sample moves the motor a little further or less far.
    shift = float(moment[i]) / motor_inertia
    y = [y[0] + shift, y[1], y[2] - motor_damping / motor_inertia * shift, y[3]]
'''

STEPS_HERE = '''def steps_here(qm, qa, vm, va, torque_motor, torque_arm):
    d, k_motor, k_arm, b_motor, b_arm = qm - qa, 0.0, 0.0, 0.0, 0.0
    vm = abs(vm) + dt * (abs(torque_motor) + abs(stiffness * d)) / motor_inertia
    va = abs(va) + dt * (abs(torque_arm) + abs(stiffness * d)) / arm_inertia
    dv, t, other, driving = vm + va, 0.0, 0.0, 0.0
    qm, qa, joint = abs(qm) + dt * vm, abs(qa) + dt * va, abs(d) + dt * dv
{steep}
    more = dt * max(b_motor / motor_inertia / 2.2 + np.sqrt(k_motor / motor_inertia),
                    b_arm / arm_inertia / 2.2 + np.sqrt(k_arm / arm_inertia))
    return max(least, min(least + int(more + 0.75), {most})) if more < 1e6 else least
'''

#: Sub-steps of a sample in which a law without a bound is steep.
HERE = '''    substeps = steps_here(y[0], y[1], y[2], y[3], float(torque[i]), float(outer[i]))
    h = dt / substeps
'''

END = '''time = t0 + dt * np.arange(n)
result = {{"time": time, "torque": torque, "states": states}}
{reading}
return result
'''
