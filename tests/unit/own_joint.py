"""A flexible joint with physics of its own, integrated here by small symmetric steps: nothing of the
project takes part."""

import math

import numpy as np
from numba import njit

TRUTH = {
    "torque_constant": 8.925,
    "stiffness": 3.971,
    "motor_inertia": 0.0635,
    "motor_damping": 2.0,
    "arm_inertia": 0.17,
    "arm_damping": 0.08,
}
DT, STEPS = 0.004, 40


@njit
def _moved(current, push, p, law, a, b, c):
    """States (n, 4). law: 1 varying inertia (a relative amplitude, b order, c phase), 2 limit by speed (a
    limit, b slope), 3 a detent at the arm (a torque, b angle, c width), 4 cubic drag at the motor (a), 5 a
    cubic spring at the arm (a, b rest), 6 a joint that creeps (a stiffness, b time constant), 7 a coupling
    that stiffens with speed (doubled at a), 8 a spring that changes with the motor's angle (a relative
    amplitude, b order), 9 an eddy-current brake at the arm (a greatest torque, b the speed of that)."""
    kt, ks, jm, bm, ja, ba = p
    out = np.zeros((len(current), 4))
    qm = qa = vm = va = z = 0.0
    h = DT / STEPS
    for i in range(len(current)):
        out[i] = qm, qa, vm, va
        for _ in range(STEPS):
            # Half a drift, a kick, half a drift: of second order, and no half step late.
            qm += 0.5 * h * vm
            qa += 0.5 * h * va
            torque, fm, fa, tau, mass = kt * current[i], 0.0, 0.0, ks * (qm - qa), ja
            if law == 1:
                mass = ja * (1.0 + a * math.cos(b * qa + c))
                fa = 0.5 * ja * a * b * math.sin(b * qa + c) * va * va
            elif law == 2:
                left = max(a - b * abs(vm), 0.0) if torque * vm > 0.0 else a
                torque = min(max(torque, -left), left)
            elif law == 3:
                x = (qa - b) / c
                fa = -a * x * math.exp(0.5 - 0.5 * x * x)
            elif law == 4:
                fm = -a * vm**3
            elif law == 5:
                fa = -a * (qa - b) ** 3
            elif law == 6:
                z += h * (qm - qa - z) / b
                tau += a * (qm - qa - z)
            elif law == 7:
                tau *= 1.0 + (vm / a) ** 2
            elif law == 8:
                tau *= 1.0 + a * math.sin(b * qm)
            elif law == 9:
                fa = -2.0 * a * b * va / (b * b + va * va)
            vm += h * (torque - bm * vm - tau + fm + push[i, 0]) / jm
            va += h * (tau - ba * va + fa + push[i, 1]) / mass
            qm += 0.5 * h * vm
            qa += 0.5 * h * va
    return out


def driven(seed, seconds=12.0, amplitude=0.5):
    """A current (n,), A: seven sines, and a small random torque (n, 2), N·m, at motor and arm."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(round(seconds / DT))
    frequencies = np.array([0.17, 0.31, 0.53, 0.83, 1.3, 1.9, 2.9]) * rng.uniform(0.93, 1.07, 7)
    phases = rng.uniform(0.0, 2.0 * np.pi, 7)
    current = amplitude / math.sqrt(7.0) * np.sin(2.0 * np.pi * np.outer(t, frequencies) + phases).sum(axis=1)
    return current * np.minimum(t / 0.5, 1.0), 0.004 * rng.standard_normal((len(t), 2))


def moved(seed, law=0, a=0.0, b=0.0, c=0.0, **options):
    """Current (n,) and what the encoders show (n, 2), in steps of 0.1 and 0.2 mrad."""
    current, push = driven(seed, **options)
    states = _moved(current, push, np.array(list(TRUTH.values())), law, a, b, c)
    steps = np.array([1e-4, 2e-4])
    return current, np.round(states[:, :2] / steps) * steps
