"""Odd random-phase multisine: equal amplitudes, the best of many random phase sets."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from haptic_teleop_control.signals.settings import Multisine

OVERSAMPLING = 16
"""Points per period of the highest harmonic, at least, on which a crest factor is measured: a peak of the
fastest sine is missed by half a point at most, so the crest factor is too low by less than 2 %."""


@lru_cache(maxsize=64)
def multisine_coefficients(settings: Multisine) -> tuple[complex, ...]:
    """c such that the signal is Re(sum of c[i] exp(2 pi j k[i] tau / period)), k = settings.harmonics().

    |c| = rms sqrt(2 / number of harmonics) for each. Phases are uniform, of `tries` sets the one with the
    lowest crest factor; the same settings give the same phases on every machine.
    """
    phases = _best_phases(settings.harmonics(), settings.seed, settings.tries)
    amplitude = settings.rms * math.sqrt(2.0 / len(phases))
    return tuple(amplitude * np.exp(1j * phases))


def crest_factor(coefficients: NDArray[np.complex128], harmonics: range) -> float:
    """Peak over root mean square of one period, from `OVERSAMPLING` points per period of the highest
    harmonic."""
    points = 1 << math.ceil(math.log2(OVERSAMPLING * harmonics[-1]))
    spectrum = np.zeros(points // 2 + 1, dtype=np.complex128)
    spectrum[list(harmonics)] = coefficients
    wave = np.fft.irfft(spectrum, points)
    return float(np.max(np.abs(wave)) / np.sqrt(np.mean(wave**2)))


def _best_phases(harmonics: range, seed: int, tries: int) -> NDArray[np.float64]:
    random = np.random.default_rng(seed)
    candidates = random.uniform(0.0, 2.0 * math.pi, size=(tries, len(harmonics)))
    return min(candidates, key=lambda phases: crest_factor(np.exp(1j * phases), harmonics))
