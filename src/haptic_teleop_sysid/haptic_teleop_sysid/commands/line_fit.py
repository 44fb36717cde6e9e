"""A straight line through a table, by least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Line:
    """y = slope x + offset: ``std``: standard error of the slope; ``left`` (n,): y less the line;
    ``residual``: rms of that by its n - 2 degrees of freedom."""

    slope: float
    offset: float
    std: float
    left: Array
    residual: float


def line_fit(x: Array, y: Array) -> Line:
    """Return the line through points (n >= 3); ``x`` (n,) must differ, in any unit."""
    design = np.column_stack([x, np.ones_like(x)])
    (slope, offset), *_ = np.linalg.lstsq(design, y, rcond=None)
    left = y - design @ np.array([slope, offset])
    variance = float(left @ left) / (len(x) - 2)
    std = float(np.sqrt(variance * np.linalg.inv(design.T @ design)[0, 0]))
    return Line(float(slope), float(offset), std, left, float(np.sqrt(variance)))
