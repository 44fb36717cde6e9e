"""The helpers that effects' equations may use (`symbols.py`), on arrays: for following an equation along a
recorded motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

NUMERIC: dict[str, Any] = {
    "side": lambda x: np.where(np.asarray(x) >= 0.0, 1.0, -1.0),
    "positive_part": lambda x: np.maximum(x, 0.0),
    "dead_band": lambda x, width: np.maximum(x - width / 2, 0.0) + np.minimum(x + width / 2, 0.0),
    "sin": np.sin,
    "cos": np.cos,
    "exp": np.exp,
    "tanh": np.tanh,
    "sech": lambda x: 1.0 / np.cosh(np.clip(x, -300.0, 300.0)),
    "abs": np.abs,
    "sqrt": np.sqrt,
    "pi": math.pi,
}
"""Helpers on arrays, by the name that equations call them."""
