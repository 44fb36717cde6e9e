"""The signals' formulas, compiled: one function for one stage at one instant.

Scalar and vectorised evaluation run this same function, so they agree to the last bit.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from haptic_teleop_control.compiled import njit
from haptic_teleop_control.signals.multisine import multisine_coefficients
from haptic_teleop_control.signals.settings import SignalSettings

# Columns of the numbers that describe one stage.
ACTIVE, DELAY, DURATION, OFFSET, SATURATION, STEP, SWEEP = 0, 1, 2, 3, 4, 5, 6
CHIRP, CHIRP_START, CHIRP_END, CHIRP_TIME, CHIRP_LOG, CHIRP_HOLD = 7, 8, 9, 10, 11, 12
SQUARE, SQUARE_PERIOD, TRIANGLE, TRIANGLE_PERIOD = 13, 14, 15, 16
SINES, SINES_PERIOD, SINES_FIRST, PIECES = 17, 18, 19, 20
COLUMNS = 21


def pack(settings: list[SignalSettings]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `evaluate` takes, from the settings of n stages: numbers (n, COLUMNS), multisine coefficients
    (n, most harmonics) complex, pieces (n, most pieces, 2) with time and level."""
    coefficients = [
        multisine_coefficients(s.multisine) if s.enabled and s.multisine.enabled else () for s in settings
    ]
    pieces = [
        tuple(zip(s.steps.times, s.steps.levels, strict=False)) if s.steps.enabled else () for s in settings
    ]
    numbers = np.zeros((len(settings), COLUMNS))
    sines = np.zeros((len(settings), max(1, *map(len, coefficients), 1)), dtype=np.complex128)
    levels = np.zeros((len(settings), max(1, *map(len, pieces), 1), 2))
    for i, s in enumerate(settings):
        chirp = s.frequency_sweep
        numbers[i, ACTIVE : SATURATION + 1] = s.enabled, s.delay, s.duration, s.offset, s.saturation
        numbers[i, STEP] = s.step.amplitude if s.step.enabled else 0.0
        numbers[i, SWEEP] = s.amplitude_sweep.frequency if s.amplitude_sweep.enabled else 0.0
        numbers[i, CHIRP] = chirp.amplitude if chirp.enabled else 0.0
        numbers[i, CHIRP_START : CHIRP_TIME + 1] = chirp.f_start, chirp.f_end, chirp.sweep_time
        numbers[i, CHIRP_LOG] = chirp.law == "logarithmic" and chirp.f_start != chirp.f_end
        numbers[i, CHIRP_HOLD] = chirp.after == "hold"
        numbers[i, SQUARE] = s.square.amplitude if s.square.enabled else 0.0
        numbers[i, TRIANGLE] = s.triangle.amplitude if s.triangle.enabled else 0.0
        numbers[i, SQUARE_PERIOD], numbers[i, TRIANGLE_PERIOD] = s.square.period, s.triangle.period
        numbers[i, SINES], numbers[i, SINES_PERIOD] = len(coefficients[i]), s.multisine.period
        numbers[i, SINES_FIRST] = s.multisine.harmonics()[0] if coefficients[i] else 1
        numbers[i, PIECES] = len(pieces[i])
        sines[i, : len(coefficients[i])] = coefficients[i]
        if pieces[i]:
            levels[i, : len(pieces[i])] = pieces[i]
    return numbers, sines, levels


@njit(cache=True)
def evaluate(t, numbers, sines, levels):  # type: ignore[no-untyped-def]
    """Values (n,) of all stages at t, s; arguments from `pack`. A t that is not finite gives zeros."""
    out = np.zeros(numbers.shape[0])
    for i in range(numbers.shape[0]):
        out[i] = evaluate_stage(t, numbers[i], sines[i], levels[i])
    return out


@njit(cache=True)
def evaluate_series(times, numbers, sines, levels):  # type: ignore[no-untyped-def]
    """Values (time, n) at all `times`."""
    out = np.zeros((times.shape[0], numbers.shape[0]))
    for k in range(times.shape[0]):
        for i in range(numbers.shape[0]):
            out[k, i] = evaluate_stage(times[k], numbers[i], sines[i], levels[i])
    return out


@njit(cache=True)
def evaluate_stage(t, p, sines, levels):  # type: ignore[no-untyped-def]
    """Value of one stage at t."""
    tau = t - p[DELAY]
    # False for a NaN, and for infinity even when the duration is unlimited.
    if p[ACTIVE] == 0.0 or not (tau >= 0.0 and tau < p[DURATION]):
        return 0.0
    x = p[STEP]
    if p[CHIRP] != 0.0:
        x += p[CHIRP] * math.sin(2.0 * math.pi * chirp_cycles(tau, p))
    if p[SQUARE] != 0.0:
        x += p[SQUARE] if tau % p[SQUARE_PERIOD] < 0.5 * p[SQUARE_PERIOD] else -p[SQUARE]
    if p[TRIANGLE] != 0.0:
        x += p[TRIANGLE] * triangle(tau % p[TRIANGLE_PERIOD] / p[TRIANGLE_PERIOD])
    if p[SINES] > 0.0:
        x += sum_of_sines(tau % p[SINES_PERIOD] / p[SINES_PERIOD], p, sines)
    if p[PIECES] > 0.0:
        x += level_at(tau, int(p[PIECES]), levels)
    if p[SWEEP] != 0.0:
        x *= math.sin(2.0 * math.pi * ((p[SWEEP] * tau) % 1.0))
    x += p[OFFSET]
    if not math.isfinite(x):  # only where f * tau overflows, some 1e300 s from the start
        return 0.0
    return min(max(x, -p[SATURATION]), p[SATURATION])


@njit(cache=True)
def chirp_cycles(tau, p):  # type: ignore[no-untyped-def]
    """Phase of the chirp in cycles, its whole cycles dropped: the integral of the frequency."""
    start, end, time, logarithmic = p[CHIRP_START], p[CHIRP_END], p[CHIRP_TIME], p[CHIRP_LOG]
    sweeps = np.floor(tau / time)
    per_sweep = one_sweep(time, start, end, time, logarithmic) % 1.0
    if p[CHIRP_HOLD] != 0.0 and sweeps >= 1.0:
        return per_sweep + (end * (tau - time)) % 1.0
    return (sweeps * per_sweep) % 1.0 + one_sweep(tau - sweeps * time, start, end, time, logarithmic) % 1.0


@njit(cache=True)
def one_sweep(tau, start, end, time, logarithmic):  # type: ignore[no-untyped-def]
    """Cycles from the start of a sweep to tau, 0 <= tau <= time."""
    if logarithmic != 0.0:
        rate = math.log(end / start) / time
        return start * math.expm1(rate * tau) / rate
    return start * tau + 0.5 * (end - start) * tau * tau / time


@njit(cache=True)
def triangle(phase):  # type: ignore[no-untyped-def]
    """Unit triangle at a phase of 0..1 of its period."""
    if phase < 0.25:
        return 4.0 * phase
    if phase < 0.75:
        return 2.0 - 4.0 * phase
    return 4.0 * phase - 4.0


@njit(cache=True)
def sum_of_sines(phase, p, sines):  # type: ignore[no-untyped-def]
    """Multisine at a phase of 0..1 of its period, by Horner's rule in exp(2 * 2 pi j phase): harmonics are
    two apart."""
    z = cmath.exp(2j * math.pi * phase)
    square = z * z
    total = 0j
    for k in range(int(p[SINES]) - 1, -1, -1):
        total = total * square + sines[k]
    first = cmath.exp(2j * math.pi * ((p[SINES_FIRST] * phase) % 1.0))
    return (total * first).real


@njit(cache=True)
def level_at(tau, count, levels):  # type: ignore[no-untyped-def]
    """Level of the last piece that has begun, zero before the first."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if levels[middle, 0] <= tau:
            low = middle + 1
        else:
            high = middle
    return levels[low - 1, 1] if low > 0 else 0.0
