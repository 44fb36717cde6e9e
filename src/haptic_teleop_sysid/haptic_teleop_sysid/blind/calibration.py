"""Whether names are right as often as their confidence says."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Pairs = list[tuple[float, bool]]
FloatArray = NDArray[np.float64]

BINS = 10
EDGES = (0.0, 0.25, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0)
_DRAWS = 2000
"""Draws for the bias and the bootstrap: their own error is a fiftieth of the spread."""


def calibration_error(pairs: Pairs) -> float | None:
    """Return the expected calibration error of (stated probability, was right): over BINS equal bins, the
    mean of |mean stated - share right|, weighted by cases. None without cases."""
    if not pairs:
        return None
    stated, right = _arrays(pairs)
    return float(_errors(stated, right[None, :])[0])


def calibration(scores: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """Return, of the scores of `score_case`, how the confidence of the first name compares with how often
    it is right, effect and place: ``ece``; ``by_chance``, its mean if names were right just as often as
    stated; ``debiased``, the difference; ``interval`` (95 %, by bootstrap over cases); ``rows``."""
    pairs = [
        (float(s["confidence"]), s["said"][0] in s["truth"])
        for s in scores
        if s["named"] and s["confidence"] is not None and s["kind"] != "clean"
    ]
    found = calibration_error(pairs)
    if found is None:
        return {"cases": 0, "ece": None, "by_chance": None, "debiased": None, "interval": None, "rows": []}
    stated, right = _arrays(pairs)
    random = np.random.default_rng(0)
    by_chance = float(np.mean(_errors(stated, random.random((_DRAWS, len(pairs))) < stated)))
    again = random.integers(len(pairs), size=(_DRAWS, len(pairs)))
    spread = float(np.std([_errors(stated[i], right[None, i])[0] for i in again]))
    debiased = found - by_chance
    return {
        "cases": len(pairs),
        "ece": found,
        "by_chance": by_chance,
        "debiased": debiased,
        "interval": [debiased - 1.96 * spread, debiased + 1.96 * spread],
        "rows": list(_rows(stated, right)),
    }


def _arrays(pairs: Pairs) -> tuple[FloatArray, FloatArray]:
    return np.array([p for p, _ in pairs]), np.array([float(r) for _, r in pairs])


def _errors(stated: FloatArray, right: NDArray[Any]) -> FloatArray:
    """The expected calibration error of each row of ``right`` (draws, cases)."""
    bins = np.minimum((stated * BINS).astype(int), BINS - 1)
    gap = right - stated
    inside = [np.abs(gap[:, bins == b].sum(axis=1)) for b in np.unique(bins)]
    return np.sum(inside, axis=0) / len(stated)


def _rows(stated: FloatArray, right: FloatArray) -> Iterable[dict[str, Any]]:
    for low, high in pairwise(EDGES):
        inside = (stated >= low) & ((stated < high) | (high == EDGES[-1]))
        if inside.any():
            yield {
                "from": low,
                "to": high,
                "cases": int(inside.sum()),
                "stated": float(stated[inside].mean()),
                "right": float(right[inside].mean()),
            }
