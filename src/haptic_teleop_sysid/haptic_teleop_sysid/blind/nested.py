"""Nested output-error fits, one effect at a time, chosen by BIC: the careful engineer's way.

The recording is cut into windows of one second; each begins at the smoothed measured state, the five free
parameters (and those of one effect) are fitted to both encoders by least squares on the simulated angles.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import butter, filtfilt

from haptic_teleop_control.compiled import njit
from haptic_teleop_sysid.blind.motion import Motion

Array = NDArray[np.float64]
CANDIDATES: tuple[tuple[str, int, float], ...] = (
    ("coulomb_friction", 1, 0.05),
    ("coulomb_friction", 2, 0.05),
    ("stribeck_friction", 3, 0.05),
    ("quadratic_drag", 4, 0.05),
    ("constant_torque", 5, 0.02),
    ("spring_to_ground", 6, 0.05),
    ("gravity", 7, 0.05),
    ("backlash", 8, 0.1),
    ("hardening_spring", 9, 0.1),
    ("joint_damping", 10, 0.05),
    ("input_delay", 11, 0.004),
    ("dead_zone", 12, 0.05),
    ("torque_saturation", 13, 0.8),
    ("payload_change", 14, 0.1),
)
"""Effect, number in the simulator, start as a share of the scale that `_scale` gives."""
WINDOW = 500
DECIMATION = 10


@njit(cache=True)
def _slope(x, u, p, kind, value, speed, late):
    kt, k, jm, bm, ja, ba = p
    d, r = x[0] - x[1], x[2] - x[3]
    joint, motor, arm, load = k * d, kt * u - bm * x[2], -ba * x[3], ja
    if kind == 1:
        motor -= value * np.tanh(x[2] / speed)
    elif kind == 2:
        arm -= value * np.tanh(x[3] / speed)
    elif kind == 3:
        motor -= value * np.tanh(x[2] / speed) * (1.0 + np.exp(-((x[2] / (10.0 * speed)) ** 2)))
    elif kind == 4:
        motor -= value * x[2] * abs(x[2])
    elif kind == 5:
        motor += value
    elif kind == 6:
        arm -= value * x[1]
    elif kind == 7:
        arm -= value * np.sin(x[1])
    elif kind == 8:
        gap = abs(value)
        joint = k * (d - min(max(d, -gap), gap))
    elif kind == 9:
        joint += value * d**3
    elif kind == 10:
        joint += value * r
    elif kind == 14 and late:
        load = max(ja + value, 0.1 * ja)
    return np.array([x[2], x[3], (motor - joint) / jm, (arm + joint) / load])


@njit(cache=True)
def _simulate(u, starts, period, p, kind, value, speed):
    n = len(u)
    out = np.empty((n, 2))
    x = starts[0].copy()
    for k in range(n):
        if k % WINDOW == 0:
            x = starts[k // WINDOW].copy()
        out[k, 0], out[k, 1] = x[0], x[1]
        drive = u[k]
        if kind == 11:
            at = k - max(value, 0.0) / period
            low = int(np.floor(at))
            drive = (
                (u[max(low, 0)] * (1.0 - at + low) + u[max(low + 1, 0)] * (at - low)) if low < n - 1 else u[k]
            )
        elif kind == 12:
            drive = np.sign(drive) * max(abs(drive) - abs(value), 0.0)
        elif kind == 13:
            drive = min(max(drive, -abs(value)), abs(value))
        late = k > n // 2
        a = _slope(x, drive, p, kind, value, speed, late)
        b = _slope(x + 0.5 * period * a, drive, p, kind, value, speed, late)
        c = _slope(x + 0.5 * period * b, drive, p, kind, value, speed, late)
        d = _slope(x + period * c, drive, p, kind, value, speed, late)
        x = x + period / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return out


def _scale(m: Motion, p: dict[str, Any], kind: int) -> float:
    torque = p["torque_constant"] * float(np.std(m.current))
    stretch = float(np.std(m.motor - m.arm))
    return {
        4: torque / float(np.std(m.motor_speed)) ** 2,
        8: stretch,
        9: p["stiffness"] / stretch**2,
        10: float(np.sqrt(p["stiffness"] * p["arm_inertia"])),
        11: 1.0,
        12: float(np.max(np.abs(m.current))),
        13: float(np.max(np.abs(m.current))),
        14: p["arm_inertia"],
    }.get(kind, torque)


_SEEN: OrderedDict[int, list[tuple[str, float]]] = OrderedDict()


def nested_fits(m: Motion, parameters: dict[str, Any], gain: float) -> list[str]:
    """Return the best effect where it improves BIC by more than `gain`, else nothing."""
    if id(m) not in _SEEN:
        _SEEN[id(m)] = _gains(m, parameters)
        while len(_SEEN) > 1:
            _SEEN.popitem(last=False)
    ranked = _SEEN[id(m)]
    return [ranked[0][0]] if ranked and ranked[0][1] > gain else []


def _gains(m: Motion, parameters: dict[str, Any]) -> list[tuple[str, float]]:
    """Return (effect, improvement of BIC), best first."""
    design: Any = butter(3, 15.0 * 2 * m.period)
    smooth = filtfilt(design[0], design[1], m.raw, axis=0)
    speeds = np.gradient(smooth, m.period, axis=0)
    u = _held(m)
    usable = len(u) // WINDOW * WINDOW
    starts = np.hstack([smooth, speeds])[:usable:WINDOW].copy()
    measured = m.raw[:usable]
    spread = np.std(measured, axis=0) + 1e-9
    names = ("torque_constant", "motor_inertia", "motor_damping", "arm_inertia", "arm_damping")
    first = np.log([max(parameters[n], 1e-6) for n in names])
    speed = 0.02 * float(np.std(m.motor_speed))

    def fitted(kind: int, start: float, scale: float, base: Array) -> tuple[float, Array]:
        def error(x: Array) -> Array:
            kt, jm, bm, ja, ba = np.exp(np.clip(x[:5], -30, 30))
            p = np.array([kt, parameters["stiffness"], jm, bm, ja, ba])
            value = x[5] * scale if kind else 0.0
            out = _simulate(u[:usable], starts, m.period, p, kind, value, speed)
            out = np.clip(out, -1e3, 1e3)
            return np.nan_to_num(
                ((out - measured) / spread)[::DECIMATION].ravel(), nan=1e3, posinf=1e3, neginf=-1e3
            )

        begin = np.append(base, start) if kind else base
        found = least_squares(error, begin, method="trf", max_nfev=15, x_scale="jac")
        n = len(found.fun)
        return n * float(np.log(2.0 * found.cost / n)) + len(begin) * float(np.log(n)), found.x

    bic, base = fitted(0, 0.0, 1.0, first)
    ranked = []
    for name, kind, start in CANDIDATES:
        value, _ = fitted(kind, start, _scale(m, parameters, kind), base)
        ranked.append((name, bic - value))
    return sorted(ranked, key=lambda pair: -pair[1])


def _held(m: Motion) -> Array:
    """Return the current on the full grid of the encoders; it was kept smoothed and thinned."""
    full = np.arange(len(m.raw)) * m.period
    return np.interp(full, m.time, m.current)
