"""Covariance of estimates: the inverse of what recordings know, and the sandwich for errors that are
correlated over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

#: A direction of the information in scaled units this much weaker than the strongest is rounding.
ROUNDING = 1e-12


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


def scaled_inverse(
    information: FloatArray, weakest: float = ROUNDING
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of an information matrix (p, p): the square roots of its diagonal (p,); its inverse (p, p) in these
    units, zero along directions that are weaker than the strongest by ``weakest``; and these directions
    (p, lost), of which nothing is known."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    if not len(scale):
        return scale, information, information
    levels, directions = np.linalg.eigh(information / np.outer(scale, scale))
    known = np.abs(levels) > weakest * np.max(np.abs(levels))
    inverse = (directions[:, known] / levels[known]) @ directions[:, known].T
    return scale, inverse, directions[:, ~known]


def sandwich(information: FloatArray, meat: FloatArray) -> FloatArray:
    """Covariance (p, p) H^-1 M H^-1 of estimates whose score has the long-run second moment M
    (`score_covariance`) and the derivative -H (White, Econometrica 50, 1982)."""
    scale, inverse, _ = scaled_inverse(information)
    inverse = inverse / np.outer(scale, scale)
    return inverse @ meat @ inverse


def deviations(covariance: FloatArray) -> FloatArray:
    """Standard deviations (p,) of a covariance (p, p)."""
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))
