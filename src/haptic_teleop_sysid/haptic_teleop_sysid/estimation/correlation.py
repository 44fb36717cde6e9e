"""Products of series with themselves or others, shifted by lags."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: Lags up to which products one after another are quicker than a transform.
FEW = 100


def correlation(a: FloatArray, b: FloatArray, lags: int) -> FloatArray:
    """(lags + 1,) sums over t of a_t b_(t+k), k = 0 ... ``lags``, of two series (n,); zero where none
    overlap."""
    n = len(a)
    if lags < FEW:
        return np.array([float(a[: n - k] @ b[k:]) if k < n else 0.0 for k in range(lags + 1)])
    full = scipy.signal.fftconvolve(b, a[::-1])[n - 1 :]
    return np.pad(full, (0, max(lags + 1 - len(full), 0)))[: lags + 1]


def autocorrelation(e: FloatArray, lags: int) -> FloatArray:
    """(lags + 1,) of a series (n,) about zero in units of its own power, 1 at lag 0 (0 where there is
    none)."""
    products = correlation(e, e, lags)
    return products / max(float(products[0]), 1e-300)
