"""Long-run second moment of scores that are correlated over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def score_covariance(scores: FloatArray, lags: int) -> FloatArray:
    """(p, p) long-run second moment of scores s_t (n, p), lags weighted as by Newey and West
    (Econometrica 55, 1987):

        sum over |k| <= L of (1 - |k|/(L+1)) sum over t of s_t s_(t+k)'

    which is the mean square of all sums over L + 1 consecutive scores, those that reach beyond the ends
    included: the pair (t, t+k) lies in L + 1 - k of them.
    """
    width = min(lags, len(scores) - 1) + 1
    total = np.cumsum(np.pad(scores, ((width, width - 1), (0, 0))), axis=0)
    sums = total[width:] - total[:-width]
    return sums.T @ sums / width
