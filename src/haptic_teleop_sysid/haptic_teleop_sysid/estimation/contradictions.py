"""Estimates that contradict what their effect is, such as a friction that falls with speed and is larger at
speed than where sliding starts: the search ended at a place that is none, or the effect is not there."""

from __future__ import annotations

import numpy as np

from haptic_teleop_sim.model import Model

from .uncertainty import Uncertainty

#: Standard errors of the difference beyond which an order counts as broken.
CLEARLY = 2.0


def contradictions(model: Model, unsure: Uncertainty | None = None) -> dict[str, str]:
    """By effect, `location.effect`: in words which two of its numbers stand in an order that it cannot have;
    empty where all is well. Without ``unsure``, or where that holds no error of them, the values count as
    exact."""
    values = model.parameter_values()
    found: dict[str, str] = {}
    for effect in model.effects:
        head = f"{effect.location}.{effect.effect}"
        for less, more, why in effect.entry.ordered:
            names = f"{head}.{less}", f"{head}.{more}"
            over = values[names[0]] - values[names[1]]
            if over > CLEARLY * _error_of_difference(unsure, *names):
                found[head] = (
                    f"{less} ({values[names[0]]:.4g}) is above {more} ({values[names[1]]:.4g}), but {why}"
                )
    return found


def _error_of_difference(unsure: Uncertainty | None, one: str, other: str) -> float:
    known = [n for n in (one, other) if unsure is not None and n in unsure.names]
    if unsure is None or not known:
        return 0.0
    places = [unsure.names.index(n) for n in known]
    std = [float(unsure.std[i]) for i in places]
    if not np.all(np.isfinite(std)):
        return 0.0
    if len(places) == 1:
        return std[0]
    together = float(unsure.correlation[places[0], places[1]])
    return float(np.sqrt(max(std[0] ** 2 + std[1] ** 2 - 2.0 * together * std[0] * std[1], 0.0)))
