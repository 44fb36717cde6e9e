"""A measured torque over one or two quantities: the model of physics that has no name.

Cubic Hermite pieces between the knots with the slopes of Fritsch and Carlson (1980), which do not overshoot;
held at its end values beyond the outermost knots.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from .entry import EffectEntry
from .map_kernel import map_series, map_value, map_value_derivatives

FloatArray = NDArray[np.float64]

#: What a map may depend on; the place in this tuple is its code in compiled code. ``angle`` and ``velocity``
#: are those of the place, at the joint the motor's. ``other_*``: the arm of the robot's other stage.
QUANTITIES = (
    "angle",
    "velocity",
    "deflection",
    "deflection_rate",
    "input",
    "other_angle",
    "other_velocity",
)


@dataclass(frozen=True)
class TorqueMap:
    """``variables``: one or two of QUANTITIES; ``knots``: ascending values of each, SI units; ``torque``: N·m
    at the knots, row by row (the last variable fastest); ``torque_std``: its standard errors, or ()."""

    variables: tuple[str, ...]
    knots: tuple[tuple[float, ...], ...]
    torque: tuple[float, ...]
    torque_std: tuple[float, ...] = ()

    @property
    def shape(self) -> tuple[int, ...]:
        """How many knots each variable has."""
        return tuple(len(k) for k in self.knots)

    def table(self) -> FloatArray:
        """Torque at the knots, N·m, of shape `shape`."""
        return np.array(self.torque).reshape(self.shape)

    def band(self) -> FloatArray | None:
        """Standard errors at the knots, N·m, of shape `shape`; None where there are none."""
        return np.array(self.torque_std).reshape(self.shape) if self.torque_std else None

    def packed(self) -> list[float]:
        """What compiled code reads: number and codes of the variables, numbers of knots, knots, and at the
        knots the torque and its slopes (along the first, the second, both)."""
        table, codes = self.table(), [float(QUANTITIES.index(v)) for v in self.variables]
        if len(self.knots) == 1:
            parts = [table, _slopes(self.knots[0], table)]
            head = [1.0, codes[0], 0.0, float(len(table)), 0.0]
        else:
            first = _slopes(self.knots[0], table)
            second = _slopes(self.knots[1], table.T).T
            parts = [table, first, second, _slopes(self.knots[1], first.T).T]
            head = [2.0, *codes, *(float(n) for n in table.shape)]
        return [*head, *(q for k in self.knots for q in k), *np.concatenate([p.ravel() for p in parts])]

    def steepest(self, names: tuple[str, ...]) -> float:
        """Largest slope between knots along the variables of these names, N·m per unit; 0 without them."""
        table, most = self.table(), 0.0
        for axis, name in enumerate(self.variables):
            if name in names:
                steps = np.diff(np.array(self.knots[axis]))
                rises = np.moveaxis(np.diff(table, axis=axis), axis, -1)
                # Between knots a cubic without overshoot is at most half as steep again.
                most = max(most, 1.5 * float(np.max(np.abs(rises / steps))))
        return most

    def at(self, *values: FloatArray) -> FloatArray:
        """Torque, N·m, at arrays of the variables of one shape."""
        p = np.array(self.packed())
        first, *more = (np.asarray(v, dtype=float) for v in values)
        flat = map_series(first.ravel(), (more[0] if more else first).ravel(), p)
        return flat.reshape(first.shape)

    def to_mapping(self) -> dict[str, Any]:
        """The parameters as the model file has them."""
        one = len(self.variables) == 1
        found: dict[str, Any] = {
            "variable": self.variables[0] if one else list(self.variables),
            "knots": list(self.knots[0]) if one else [list(k) for k in self.knots],
            "torque": self.table().tolist(),
        }
        band = self.band()
        return found if band is None else {**found, "torque_std": band.tolist()}


def _slopes(knots: tuple[float, ...], values: FloatArray) -> FloatArray:
    """Slopes at the knots along the first axis."""
    curve = scipy.interpolate.PchipInterpolator(np.array(knots), values, axis=0)
    return np.asarray(curve(np.array(knots), 1), dtype=float)


TORQUE_MAP = EffectEntry(
    name="torque_map",
    kind="torque",
    where=("motor", "arm", "joint"),
    parameters=(),
    sentence="a measured curve or surface of torque stands for physics without a name",
    compiled=(map_value, map_value_derivatives),
    tabulated=True,
    condition="what its map depends on",
    needs="a diagnosis that ended without a name, or a curve measured by itself",
)
ENTRIES = (TORQUE_MAP,)
